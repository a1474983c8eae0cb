"""Vision as a sense: the camera's images, laid on the ground ahead."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile
from ..framework.core.html import picture
from ..framework.core.pooling import cells_of
from ..framework.core.recording.types import Recording
from ..framework.core.track.way import Places
from ..framework.senses import Observation, Sense, register


@register
class Vision(Sense):
    """Recognises the ground on images."""

    name = "vision"
    instrument = "camera"
    takes_backbone = True

    def train(
        self,
        labelled: Sequence[LabelledFile],
        rng: np.random.Generator,
        *,
        notes: Sequence[str] = (),
        backbone: Path | None = None,
    ) -> TrainingOutcome:
        """Train on photographs of ground, with an image network's features beside the built-in ones if one is given."""
        from .backbone import open_backbone
        from .train import train_vision

        network = None if backbone is None else open_backbone(backbone)
        return train_vision(labelled, rng, notes=notes, backbone=network)

    def excerpt(self, sample: LabelledFile) -> str:
        """Show the photograph, small."""
        from .classify import thumbnail

        return picture(thumbnail(sample.file), "jpeg", sample.file.name)

    def remarks(self, model: TerrainClassifier) -> tuple[str, ...]:
        """Say what a backbone costs."""
        from .measures import measures_of

        if model.settings.get("backbone") is None:
            return ()
        backbone = measures_of(model).backbone
        assert backbone is not None
        return (f"the model of {self.name} measures by its {backbone.cost()}",)

    def classify(self, files: Sequence[Path], model: TerrainClassifier) -> list[dict]:
        """Name the ground on photographs, one row a file."""
        from .classify import classify_images

        return classify_images(files, model)

    def absence(self, recording: Recording) -> str:
        """Say what is missing: images, or the camera's geometry."""
        if not self.recorded(recording):
            return "no camera in the recording"
        if recording.vehicle is None or recording.vehicle.camera is None:
            return "the vehicle's description has no [camera], so images cannot be laid on the ground"
        return ""

    def recorded(self, recording: Recording) -> bool:
        """Say whether there are images."""
        return recording.camera is not None and len(recording.camera) > 0

    def observe(
        self, recording: Recording, track: Places, model: TerrainClassifier, cell_size_m: float
    ) -> Iterator[Observation]:
        """Look at the ground ahead, a few frames at a time."""
        from .observe import observe_ground

        images, camera = recording.camera, recording.vehicle.camera if recording.vehicle else None
        assert images is not None and camera is not None  # noqa: PT018 - see `absence`
        for looks in observe_ground(images, camera, track.place_at, track.speed_at, model, cell_size_m):
            item = np.flatnonzero(np.isfinite(looks.x_m) & np.isfinite(looks.y_m) & np.isfinite(looks.time_s))
            cells = cells_of(looks.x_m[item], looks.y_m[item], cell_size_m)
            yield Observation(looks.evidence, looks.time_s, item, cells)
