"""What hangs back where it turns round: play and hysteresis are none of the catalogue's, and no delay."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.locate.play import BEHIND_PLAY, held_back
from bevameter.identification.mismatch.show.shape import shape_of

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.012, stiffness_Pa=2.5e5, n=0.95)
ROWS, STEP_S = 600, 0.1


def loose(series: np.ndarray, half: float) -> np.ndarray:
    """What a joint with play passes on: it is taken along by either end of its gap."""
    passed, answer = series[0], []
    for value in series:
        if value - passed > half:
            passed = value - half
        elif passed - value > half:
            passed = value + half
        answer.append(passed)
    return np.array(answer)


def drive(seed: int, play: float = 0.0, late: int = 0) -> Recording:
    """A drive whose sinkage is read behind a joint with play, as a share of its range, or some rows late."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)
    load = 90.0 + 35.0 * np.sin(time_s / 2.1) + 20.0 * np.sin(time_s / 5.3)
    slip = 0.3 + 0.18 * np.sin(time_s / 3.3) + 0.08 * np.sin(time_s / 0.9)
    state = equilibrium(WHEEL, SOIL, load, slip)
    sinkage = loose(state.sinkage_m, play * float(np.ptp(state.sinkage_m)))
    sinkage = np.concatenate([np.full(late, sinkage[0]), sinkage])[:ROWS]
    channels = {"torque_Nm": state.torque_Nm, "sinkage_m": sinkage, "drawbar_pull_N": state.drawbar_pull_N}
    noisy = {name: each + 0.01 * np.ptp(each) * rng.normal(size=ROWS) for name, each in channels.items()}
    imposed = {"load_N": load + 0.3 * rng.normal(size=ROWS), "slip": slip + 0.001 * rng.normal(size=ROWS)}
    table = WheelTable({"time_s": time_s, **imposed, **noisy}, None, None, "made")
    return Recording("made", Path(), Vehicle(name="made", wheels=(WHEEL,)), None, "", "", wheel=table)


def test_play_holds_back_by_half_a_gap_either_way_and_starts_anew_in_each_stretch():
    way = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.0, 101)])
    columns = held_back(way, np.zeros(len(way)))
    for column, half in zip(columns.T, (0.03, 0.1), strict=True):
        assert column == pytest.approx((loose(way, half) - way) / half)
        assert column[90] == pytest.approx(-1.0)
        assert column[-1] == pytest.approx(1.0)
    apart = held_back(way, np.repeat([0.0, 1.0], 101))
    assert apart[101] == pytest.approx([0.0, 0.0])
    missing = np.where(np.arange(len(way)) == 50, np.nan, way)
    assert held_back(missing, np.zeros(len(way)))[50] == pytest.approx([0.0, 0.0])
    assert not held_back(np.ones(5), np.zeros(5)).any()
    assert not held_back(np.full(5, np.nan), np.zeros(5)).any()


def test_it_is_told_in_words_with_half_its_gap():
    way = np.sin(np.linspace(0.0, 12.0, 200))
    own = 0.0015 * held_back(way, np.zeros(200))[:, 0]
    shape = shape_of("sinkage_m", "sinkage_m" + BEHIND_PLAY, way, own)
    assert shape.words.startswith("sinkage z hangs back by 1.5 mm where it turns round")
    assert shape.formula == "play of 0.0015 in sinkage_m"


@pytest.mark.parametrize("seed", [0, 1])
def test_play_is_no_delay(seed):
    answer = explain(drive(seed, play=0.03))
    assert answer.verdict == "unknown"
    assert "hangs back" in answer.missing[0].description
    assert all(each.probability < 0.5 for each in answer.missing[1:])


def test_a_delay_is_no_play_and_nothing_is_neither():
    late = explain(drive(2, late=4))
    assert [each.effect for each in late.missing] == ["time_lag"]
    assert late.missing[0].probability > 0.9
    assert explain(replace(drive(3), name="nothing")).verdict == "none"
