"""Contact sound as a sense: what the microphone hears below the wheels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile
from ..framework.core.html import player
from ..framework.core.recording.types import Recording
from ..framework.core.track.way import Places
from ..framework.senses import Observation, Sense, register


@register
class Audio(Sense):
    """Recognises the ground by the sound of the wheels' contact."""

    name = "audio"
    instrument = "microphone"

    def train(
        self, labelled: Sequence[LabelledFile], rng: np.random.Generator, *, notes: Sequence[str] = ()
    ) -> TrainingOutcome:
        """Train on recorded sounds."""
        from .train import train_audio

        return train_audio(labelled, rng, notes=notes)

    def classify(self, files: Sequence[Path], model: TerrainClassifier) -> list[dict]:
        """Classify sound files window by window."""
        from .classify import classify_sounds

        return classify_sounds(files, model)

    def excerpt(self, sample: LabelledFile) -> str:
        """Play the stretch, as loud as the others."""
        from .classify import clip

        return player(clip(sample.file, sample.start_s or 0.0, sample.end_s))

    def absence(self, recording: Recording) -> str:
        """Say that there is no sound."""
        there = recording.sound is not None and recording.sound.duration_s > 0
        return "" if there else "no sound in the recording"

    def observe(
        self, recording: Recording, track: Places, model: TerrainClassifier, cell_size_m: float
    ) -> Iterator[Observation]:
        """Listen to the ground below, about half a minute at a time."""
        from .listen import listen

        assert recording.sound is not None  # see `absence`
        for heard in listen(recording.sound, model):
            yield Observation.under_wheels(heard.evidence, heard.start_s, heard.end_s, recording, track, cell_size_m)
