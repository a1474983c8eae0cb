"""Vibration as a sense: what an inertial sensor at the vehicle's frame hears of the ground through the structure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile
from ..framework.core.recording.types import Recording
from ..framework.core.track.way import Places
from ..framework.senses import Observation, Sense, register


@register
class Vibration(Sense):
    """Recognises the ground by structure-borne sound."""

    name = "vibration"
    instrument = "vibration sensor"

    def train(
        self, labelled: Sequence[LabelledFile], rng: np.random.Generator, *, notes: Sequence[str] = ()
    ) -> TrainingOutcome:
        """Train on vibration files, and the wheel drives' files of the same runs."""
        from .vibration_train import train_vibration

        return train_vibration(labelled, rng, notes=notes)

    def classify(self, files: Sequence[Path], model: TerrainClassifier) -> list[dict]:
        """Classify vibration files window by window."""
        from .vibration import classify_vibration

        return classify_vibration(files, model)

    def absence(self, recording: Recording) -> str:
        """Say that there is no vibration."""
        return "" if recording.vibration is not None else "no vibration in the recording"

    def observe(
        self, recording: Recording, track: Places, model: TerrainClassifier, cell_size_m: float
    ) -> Iterator[Observation]:
        """Classify the whole run, which is in memory; a window tells of the ground below its middle half."""
        from .vibration import vibration_evidence

        run = recording.vibration
        assert run is not None  # see `absence`
        start_s, end_s, evidence = vibration_evidence(run, model)
        quarter_s = 0.25 * (end_s - start_s)
        start_s[1:] += quarter_s[1:]
        end_s[:-1] -= quarter_s[:-1]
        began = float(run.time_s[0])
        yield Observation.under_wheels(evidence, began + start_s, began + end_s, recording, track, cell_size_m)
