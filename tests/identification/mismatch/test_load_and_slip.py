"""How well load and slip are known: what really changes from row to row is no noise of theirs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bevameter.identification.mismatch.fit.samples as samples_module
import numpy as np
import pytest
from bevameter import Vehicle, explain
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.identification.effects.drive import drive_of
from bevameter.identification.effects.effect import LOAD, PULL, SLIP, TORQUE
from bevameter.identification.mismatch.explanation import Explanation
from bevameter.identification.mismatch.fit.load_and_slip import gathered
from bevameter.identification.mismatch.fit.samples import gather
from restless_drive import ROWS, WHEEL, drive


def noises(
    table: WheelTable, stated: dict[str, float] | None = None, channels: tuple[int, ...] = (LOAD, SLIP)
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """What neighbours show of load and slip or of other channels, and what answers do."""
    vehicle = Vehicle(name="made", wheels=(WHEEL,), noise=stated or {})
    shown = gather(table, WHEEL, vehicle).noise
    told = gathered(table, WHEEL, vehicle, SoilKnowledge()).noise
    return shown[list(channels)], told[list(channels)]


def test_rows_are_chosen_once_however_many_noises_are_tried(monkeypatch):
    """What a drive is does not depend on how well its load and slip are known."""
    chosen = []
    monkeypatch.setattr(samples_module, "drive_of", lambda *given: chosen.append(given) or drive_of(*given))
    gathered(drive(0, (0.04, 0.02), (0.0, 0.0)), WHEEL, Vehicle(name="made", wheels=(WHEEL,)), SoilKnowledge())
    assert len(chosen) == 1


@pytest.mark.parametrize("seed", range(4))
def test_what_answers_follow_is_no_noise(seed):
    shown, told = noises(drive(seed, (0.04, 0.02), (0.0, 0.0)))
    assert shown[1] > 0.012
    assert (told < 0.25 * shown).all()


@pytest.mark.parametrize("seed", range(4))
def test_rows_far_apart_that_the_average_of_neighbours_has_nothing_of_are_told_too(seed):
    """Slip leaps by 0.1 from row to row: the soil that is fitted to averages of it is a wrong one."""
    table = drive(seed, (0.15, 0.1), (0.01, 0.004), friction_Nm=0.2)
    shown, told = noises(table.select(np.arange(0, ROWS, 4)))
    assert shown[1] > 0.08
    assert told[1] == pytest.approx(0.004, abs=0.004)
    assert told[0] == pytest.approx(1.5, rel=0.5)


@pytest.mark.parametrize("seed", range(3))
def test_gross_errors_tell_nothing_of_noise(seed):
    """Spikes of two rows each in a torque that is known to 0.05 Nm."""
    table = drive(seed, (0.04, 0.02), (0.01, 0.006))
    torque, rng = table["torque_Nm"].copy(), np.random.default_rng(seed)
    for row in rng.choice(ROWS - 1, 12, replace=False):
        torque[row : row + 2] += 8.0
    spiked = replace(table, columns={**table.columns, "torque_Nm": torque})
    _, told = noises(spiked, None, (LOAD, SLIP, TORQUE))
    assert told == pytest.approx([1.5, 0.006, 0.05], rel=0.45)


def test_what_is_stated_of_one_stands_where_the_other_is_told():
    _, told = noises(drive(2, (0.04, 0.02), (0.01, 0.0)), {"load_N": 1.5})
    assert told[0] == 1.5
    assert told[1] < 0.005


@pytest.mark.parametrize("seed", range(6))
def test_what_they_do_not_follow_is(seed):
    shown, told = noises(drive(seed, (0.0, 0.0), (0.02, 0.012)))
    np.testing.assert_allclose(told, shown, rtol=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_of_both_together_the_noise_is_told(seed):
    shown, told = noises(drive(seed, (0.0, 0.016), (0.0, 0.006)))
    assert shown[1] > 0.012
    assert told[1] == pytest.approx(0.006, rel=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_slip_is_what_it_probably_was_and_known_as_well_as_it_is(seed):
    table = drive(seed, (0.0, 0.014), (0.0, 0.014))
    samples = gathered(table, WHEEL, Vehicle(name="made", wheels=(WHEEL,)), SoilKnowledge())
    for found in (samples.drive.slip, samples.measured[:, SLIP]):
        error = float(np.sqrt(np.mean((found - table["true_slip"]) ** 2)))
        assert error < 0.8 * 0.014
        assert samples.noise[SLIP] == pytest.approx(error, rel=0.3)


def test_rows_too_few_or_too_far_apart_do_not_tell_the_noise_of_answers():
    """Without neighbours in time differences of neighbours are none, and no noise of zero."""
    table = drive(1, (0.0, 0.0), (0.0, 0.0))
    bursts = np.arange(ROWS) // 2 * 4.0 + 0.2 * (np.arange(ROWS) % 2)
    shown, told = noises(replace(table, columns={**table.columns, "time_s": bursts}), None, (TORQUE, PULL))
    np.testing.assert_array_equal(told, shown)
    shown, told = noises(drive(2, (0.04, 0.02), (0.0, 0.0)).select(np.arange(20)), None, (TORQUE, PULL))
    np.testing.assert_array_equal(told, shown)


@pytest.mark.filterwarnings("error")
def test_channels_of_zeros_have_a_noise():
    table, vehicle = drive(1, (0.04, 0.02), (0.0, 0.0)), Vehicle(name="made", wheels=(WHEEL,))
    for name, channel in (("torque_Nm", TORQUE), ("slip", SLIP)):
        still = replace(table, columns={**table.columns, name: np.zeros(ROWS)})
        found = gathered(still, WHEEL, vehicle, SoilKnowledge())
        assert found.noise[channel] == gather(still, WHEEL, vehicle).noise[channel] > 0.0
        assert not any("slip seems to change" in note for note in found.notes)


def test_what_the_vehicle_states_stands():
    stated = {"slip": 0.015, "load_N": 6.0}
    _, told = noises(drive(1, (0.04, 0.02), (0.0, 0.0)), stated)
    np.testing.assert_array_equal(told, [6.0, 0.015])


@pytest.mark.parametrize("stated", [{}, {"load_N": 0.5, "slip": 0.001}])
def test_what_load_and_slip_do_to_answers_is_no_noise_of_theirs(stated):
    shown, told = noises(drive(2, (0.04, 0.02), (0.0, 0.0)), stated, (TORQUE, PULL))
    assert (shown > 4.0 * np.array([0.05, 0.4])).all()
    np.testing.assert_allclose(told, [0.05, 0.4], rtol=0.2)


def explained(table: WheelTable, stated: dict[str, float]) -> Explanation:
    vehicle = Vehicle(name="made", wheels=(WHEEL,), noise=stated)
    return explain(Recording("table", Path("table.csv"), vehicle, None, "", "0" * 64, wheel=table))


def test_a_wrong_zero_shows_more_clearly_beside_it():
    table = drive(3, (0.0, 0.02), (0.0, 0.0), friction_Nm=0.08)
    as_shown, told = explained(table, {"slip": 0.02}), explained(table, {})
    assert told.missing[0].effect == "torque_offset"
    assert told.heldout_nats.value > as_shown.heldout_nats.value + 10.0
    assert any("slip seems to change from row to row" in note and "neighbours show 0.02" in note for note in told.notes)
    assert not any("from row to row" in note for note in as_shown.notes)


def test_nothing_is_missing_from_a_restless_drive():
    found = explained(drive(5, (0.03, 0.02), (0.0, 0.003)), {})
    assert found.verdict == "none"
    assert any("slip seems to change" in note for note in found.notes)
