"""Scores of the senses on synthetic drives of known truth, look by look and window by window.

The input is that of a recording: pictures as JPEG, cut into cells ahead of the vehicle, and 16-bit sound cut into
windows. What is judged is what is stated: a class, a probability, or nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from bevameter.audio.classify import sound_evidence
from bevameter.audio.vibration import vibration_evidence
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.scores import calibration_error
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.recording.camera import decode_image
from bevameter.framework.core.recording.types import Frame, Wanted, always
from bevameter.framework.scenario.hearing import heard
from bevameter.framework.scenario.plan import Plan
from bevameter.framework.scenario.seeing import frame_times, ground_sites, seen
from bevameter.framework.scenario.view import GroundSite
from bevameter.vision.observe import observe_ground
from synthetic_samples import felt_run

SURE = 0.9
"""Probability from which on a statement counts as sure [-]."""


@dataclass(frozen=True)
class Judged:
    """What a sense stated along a drive, and what was true.

    Parameters
    ----------
    evidence
        n looks or windows, all of ground of one class.
    truth
        n class names.
    fault
        n names of what was wrong with the sensor just then; empty where nothing was.
    """

    evidence: ClassEvidence
    truth: np.ndarray
    fault: np.ndarray

    def scores(self, rows: np.ndarray | None = None) -> dict[str, float]:
        """Score the statements of some rows (n,) bool, by default all where the sensor was well.

        Returns
        -------
        dict
            n; known: share with an open gate; of those: accuracy, balanced_accuracy (mean over the classes there),
            said (mean of the stated probability), calibration_error; sure: share stated with `SURE` or more, and
            sure_right: how often that was right. NaN where nothing was stated.
        """
        chosen: np.ndarray = np.asarray(self.fault == "") if rows is None else rows
        known = chosen & ~self.evidence.unknown & (self.evidence.quality > 0)
        answer = {"n": float(chosen.sum()), "known": float(known.sum() / max(chosen.sum(), 1))}
        if not known.any():
            return answer | dict.fromkeys(
                ("accuracy", "balanced_accuracy", "said", "calibration_error", "sure", "sure_right"), np.nan
            )
        p, truth = self.evidence.probabilities[known], self.truth[known]
        top = p.max(axis=1)
        right = np.asarray(self.evidence.classes)[p.argmax(axis=1)] == truth
        sure = top >= SURE
        # A class that the model does not know is never right.
        index = np.array([{n: i for i, n in enumerate(self.evidence.classes)}.get(name, -1) for name in truth])
        return answer | {
            "accuracy": float(right.mean()),
            "balanced_accuracy": float(np.mean([right[truth == name].mean() for name in np.unique(truth)])),
            "said": float(top.mean()),
            "calibration_error": calibration_error(p, index, np.ones(len(p)))[0],
            "sure": float(sure.mean()),
            "sure_right": float(right[sure].mean()) if sure.any() else np.nan,
        }


def judge_camera(plan: Plan, model: TerrainClassifier, cell_size_m: float = 0.5) -> Judged:
    """Show a drive to the camera's classifier; cells that lie across a boundary of classes are left out.

    Parameters
    ----------
    plan
        Of a preset with a camera.
    model
        Of modality ``"vision"``.
    cell_size_m
        Side of a cell [m].

    Raises
    ------
    InputError
        There is no camera, or the model is for other features.
    """
    camera = plan.preset.vehicle.camera
    if camera is None:
        raise InputError("scenario", "a vehicle without a camera", expected="one with a camera")

    def pose_at(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return plan.at(plan.x_m, time_s), plan.at(plan.y_m, time_s), plan.at(plan.yaw_rad, time_s)

    def speed_at(time_s: np.ndarray) -> np.ndarray:
        return plan.at(plan.speed_m_s, time_s)

    parts = list(observe_ground(_Film(plan), camera, pose_at, speed_at, model, cell_size_m))
    time_s, x, y = (np.concatenate([getattr(part, name) for part in parts]) for name in ("time_s", "x_m", "y_m"))
    sites = ground_sites(plan, tile_px=64)
    owner = stretch_of(sites, x, y)
    reach = 0.4 * cell_size_m
    whole = np.ones(len(x), dtype=bool)
    for dx, dy in ((reach, reach), (reach, -reach), (-reach, reach), (-reach, -reach)):
        whole &= stretch_of(sites, x + dx, y + dy) == owner
    faults = ("camera_black", "camera_truncated", "camera_overexposed")
    return _judged(plan, ClassEvidence.concatenate([part.evidence for part in parts]), owner, time_s, faults, whole)


def judge_microphone(plan: Plan, model: TerrainClassifier) -> Judged:
    """Let the microphone's classifier hear a drive; windows across a boundary of classes are left out.

    Parameters
    ----------
    plan
        Of a preset with a microphone.
    model
        Of modality ``"audio"``.

    Raises
    ------
    InputError
        There is no microphone, or the model is for other features.
    """
    rate = plan.preset.sound_rate_Hz
    if rate is None:
        raise InputError("scenario", "a vehicle without a microphone", expected="one with a microphone")
    sound = np.concatenate(list(heard(plan)))
    stored = (np.round(sound * 32767.0) / 32768.0).astype(np.float32)
    start_s, end_s, evidence = sound_evidence(stored, rate, model)
    start_s, end_s = start_s + plan.preset.sound_start_s, end_s + plan.preset.sound_start_s
    edges = [stretch.start_s for stretch in plan.stretches][1:]
    owner = np.searchsorted(edges, start_s, side="right")
    whole = owner == np.searchsorted(edges, end_s - 1e-6, side="right")
    thirds = np.linspace(start_s + 0.01, end_s - 0.01, 4)
    return _judged(plan, evidence, owner, thirds, ("wind", "engine", "microphone_dropout"), whole)


def judge_vibration(plan: Plan, model: TerrainClassifier) -> Judged:
    """Let the inertial sensor's classifier feel a drive; windows across a boundary of classes are left out.

    Parameters
    ----------
    plan
        Of a preset with an inertial sensor.
    model
        Of modality ``"vibration"``.

    Raises
    ------
    InputError
        There is no inertial sensor, or the model is for other features.
    """
    if not plan.preset.inertial:
        raise InputError("scenario", "a vehicle without an inertial sensor", expected="one with an inertial sensor")
    start_s, end_s, evidence = vibration_evidence(felt_run(plan), model)
    edges = [stretch.start_s for stretch in plan.stretches][1:]
    owner = np.searchsorted(edges, start_s, side="right")
    whole = owner == np.searchsorted(edges, end_s - 1e-6, side="right")
    return _judged(plan, evidence, owner, start_s, (), whole)


class _Film:
    """The pictures of a drive as a stream, taken while they are looked at."""

    def __init__(self, plan: Plan):
        self._plan = plan

    def __len__(self) -> int:
        return len(frame_times(self._plan))

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        for picture in seen(self._plan):
            if not wanted(picture.time_s):
                continue
            try:
                yield Frame(picture.time_s, decode_image(picture.data, "picture"), None)
            except InputError as error:
                yield Frame(picture.time_s, None, str(error))


def stretch_of(sites: Sequence[GroundSite], x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Number of the stretch that places of the site frame belong to, as the renderer draws them: (n,)."""
    owner = np.zeros(len(x_m), dtype=int)
    for number, site in enumerate(sites[1:], start=1):
        owner[site.beyond(x_m, y_m)] = number
    return owner


def _judged(
    plan: Plan, evidence: ClassEvidence, owner: np.ndarray, time_s: np.ndarray, faults: Sequence[str], whole: np.ndarray
) -> Judged:
    truth = np.array([stretch.terrain for stretch in plan.stretches])[owner]
    fault = np.full(len(truth), "", dtype="U24")
    for kind in faults:
        on = plan.fault(kind, time_s)
        fault[on.any(axis=0) if on.ndim == 2 else on] = kind
    return Judged(evidence.select(whole), truth[whole], fault[whole])
