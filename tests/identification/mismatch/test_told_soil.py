"""A soil stated from elsewhere that is not the one under the wheel."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.soil import PARAMETERS, SoilKnowledge
from bevameter.identification.effects.soil_patch import SoilPatch
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.places import everywhere
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import textbook_trial, try_adding
from bevameter.identification.mismatch.name.evidence import off_what_is_stated
from bevameter.identification.mismatch.show.told_soil import disagreement

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.012, stiffness_Pa=2.5e5, n=0.95)
ROWS = 300


@pytest.fixture(scope="module")
def columns():
    """A drive of one metre and a half over the soil, with noise of a hundredth of the channels' ranges."""
    rng = np.random.default_rng(5)
    time_s = 0.1 * np.arange(ROWS)
    load, slip = 90.0 + 40.0 * np.sin(time_s / 3.1), 0.3 + 0.2 * np.sin(time_s / 2.3)
    state = equilibrium(WHEEL, SOIL, load, slip)
    channels = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    channels = channels + 0.01 * np.ptp(channels, axis=0) * rng.normal(size=(ROWS, 3))
    names = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    made = {"time_s": time_s, "load_N": load, "slip": slip, "x_m": 0.05 * time_s}
    return made | dict(zip(names, channels.T, strict=True))


@pytest.fixture(scope="module")
def samples(columns):
    return gather(WheelTable(columns, None, None, Path("drive")), WHEEL, Vehicle(wheels=(WHEEL,)))


def stated(stiffness_Pa: float) -> SoilKnowledge:
    values = {"phi_rad": SOIL.phi_rad, "stiffness_Pa": stiffness_Pa, "n": SOIL.n}
    return SoilKnowledge(values, {"phi_rad": 0.02, "stiffness_Pa": 0.1 * stiffness_Pa, "n": 0.02})


@pytest.mark.parametrize(("off_sd", "doubted"), [(3.0, False), (5.0, True), (-5.0, True)])
def test_a_set_beside_which_the_soil_is_still_another_one_is_doubted(samples, off_sd, doubted):
    """Cohesion and friction were 4 and 12 standard deviations off beside a hump that stood in for a cap on the rim."""
    known = stated(SOIL.stiffness_Pa)
    problem, textbook = textbook_trial(samples, known)
    assert not off_what_is_stated(problem, textbook)
    at = PARAMETERS.index("phi_rad")
    prior, vector = problem.prior(textbook.fitted.model), textbook.fitted.vector.copy()
    vector[at] = prior.mean[at] + off_sd / math.sqrt(prior.precision[at])
    other = replace(textbook, fitted=replace(textbook.fitted, vector=vector))
    assert off_what_is_stated(problem, other) == doubted
    exact, _ = textbook_trial(samples, SoilKnowledge(known.values, {}))
    assert not off_what_is_stated(exact, other), "a soil that is given has no standard deviation to be off by"


def test_a_soil_stated_otherwise_than_the_wheel_finds_it_is_said(samples):
    said = disagreement(samples, stated(SOIL.stiffness_Pa / WHEEL.width_m**SOIL.n))
    assert said is not None
    # that of (sinkage / width)^n is 250 kPa, that of sinkage^n 2228 kPa
    assert "stiffness k1 + k2 b 2230 ± 220 kPa stated" in said
    assert "friction angle phi 31.0 ± 1.1 deg stated" in said
    assert "(sinkage / width)^n" in said


def test_nothing_is_said_of_a_soil_stated_rightly_or_not_at_all(samples):
    assert disagreement(samples, stated(SOIL.stiffness_Pa)) is None
    assert disagreement(samples, SoilKnowledge()) is None


def test_explain_says_it_of_a_soil_stated_wrongly_whatever_is_found(columns, tmp_path):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "wheel.csv", rows, delimiter=",", header=",".join(columns), comments="")
    (tmp_path / "vehicle.toml").write_text(f"[wheel]\nradius_m = {WHEEL.radius_m}\nwidth_m = {WHEEL.width_m}\n")
    (tmp_path / "recording.toml").write_text('operator = "somebody"\n')
    answers = [
        explain(tmp_path, soil=stated(share * SOIL.stiffness_Pa), catalogue=["load_gain"]) for share in (1.0, 8.0)
    ]
    said = [[note for note in answer.notes if "soil stated" in note] for answer in answers]
    assert [len(each) for each in said] == [0, 1]
    assert "recording.toml: operator left out, nothing here reads that" in answers[0].notes


def test_only_what_is_stated_is_spoken_of(samples):
    exact = disagreement(samples, SoilKnowledge({"phi_rad": 0.2}))
    assert exact is not None
    assert "friction angle phi 11.5 deg stated" in exact
    assert "stiffness" not in exact


def test_another_soil_all_along_is_no_place(samples):
    along = samples.drive.place_m
    patch = SoilPatch("place", along)
    model = AugmentedWheel(WHEEL, (patch,))

    def covers(first: float, last: float) -> bool:
        vector = np.array([800.0, 0.6, -4.4, 12.4, 0.0, -0.5, 0.0, first, last])
        return everywhere(SimpleNamespace(model=model, vector=vector), samples.drive)

    assert covers(along.min() - 0.01, along.max() + 0.01)
    assert not covers(along.min() + 0.2 * np.ptp(along), along.max())
    # However many of the rows lie there: a wheel is slow in soft soil.
    slow = np.where(np.arange(ROWS) < 290, 0.4, 1.0) * np.ptp(along) + along.min()
    slow[0] = along.min()
    part = SimpleNamespace(
        model=model, vector=np.array([800.0, 0.6, -4.4, 12.4, 0.0, -0.5, 0.0, slow[1] - 0.1, slow[1] + 0.1])
    )
    assert not everywhere(part, replace(samples.drive, place_m=slow))


def test_a_soil_stated_wrongly_is_not_called_a_patch_of_the_whole_track(samples):
    problem, textbook = textbook_trial(samples, stated(8.0 * SOIL.stiffness_Pa))
    whole = SoilPatch("place", samples.drive.place_m, [np.array([-2.0, 0.0, -0.001, 1.5])])
    trial = try_adding(problem, textbook, textbook, whole)
    assert trial.fitted.score > textbook.fitted.score + 5.0
    assert everywhere(trial.fitted, samples.drive)
    assert trial.gain <= 0.0
