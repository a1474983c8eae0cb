"""`explain` on recordings in which physics is concealed, and on files that are short, long, broken or poor."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, explain
from bevameter import simulate as simulate_file
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_file import write_wheel_file
from bevameter.identification.effects.catalogue import SLUGS
from bevameter.identification.mismatch.explanation import to_json
from concealed.conceal import conceal
from concealed.mechanics import simulate
from judging.scorer import score

SEED = 7100


def recorded(folder: Path, seed: int, slugs, level="hidden", protocol="steady"):
    made = conceal(seed, slugs, level, protocol=protocol)
    assert made.truth["reached"]
    return made, made.write(folder / f"{seed}")


def edited(folder: Path, change) -> Path:
    """Rewrite the wheel file of a recording; `change` is given its columns and gives new ones."""
    table = read_recording(folder).wheel
    columns = {name: values.copy() for name, values in table.columns.items()}
    write_wheel_file(WheelTable(change(columns), table.wheel, table.run, folder / "wheel.csv"), folder / "wheel.csv")
    return folder


def names(answer) -> set[str]:
    return {missing.effect for missing in answer.missing}


@pytest.mark.parametrize(("seed", "protocol"), [(SEED, "steady"), (SEED + 1, "bench"), (SEED + 2, "field")])
def test_nothing_is_found_where_nothing_is_missing(tmp_path, seed, protocol):
    _, folder = recorded(tmp_path, seed, (), "plain", protocol)
    answer = explain(folder)
    assert answer.verdict == "none"
    assert answer.missing == ()
    assert answer.located == ()
    assert "nothing was found" in answer.summary


@pytest.mark.parametrize(
    ("slug", "protocol"),
    [("slip_sinkage", "steady"), ("bulldozing", "steady"), ("torque_gain", "steady"), ("time_lag", "bench"),
     ("multipass_compaction", "bench")],
)  # fmt: skip
def test_what_is_missing_is_named_and_the_fit_improves(tmp_path, slug, protocol):
    made, folder = recorded(tmp_path, SEED + 10, (slug,), "plain", protocol)
    answer = explain(folder)
    result = score(made.truth, to_json(answer))
    assert result["named"]
    assert result["kind_right"]
    assert not result["falsely_named"]
    assert np.mean(list(result["error_ratio"].values())) < 1.25
    channel = made.truth["effects"][0]["channels"][0]
    assert answer.fits[channel].rmse_after < answer.fits[channel].rmse_before
    assert result["located_channel"]
    assert result["located_variable"]


def test_what_was_found_simulates_and_is_kept_with_the_class(tmp_path):
    _, folder = recorded(tmp_path, SEED + 10, ("slip_sinkage",), "plain")
    answer = explain(folder)
    recording = read_recording(folder)
    simulated = answer.physics.simulate(recording.vehicle, recording.wheel)
    measured = recording.wheel["sinkage_m"]
    alone = simulate_file(recording.vehicle, answer.physics.soil_values, recording.wheel)
    error = [float(np.nanstd(measured - table["sinkage_m"])) for table in (simulated, alone)]
    assert error[0] < 0.5 * error[1]
    database = TerrainDatabase(tmp_path / "terrain.db")
    database.add_physics("sand", answer.physics, source=answer.source)
    kept = database.physics("sand")[0].physics
    assert [effect.slug for effect in kept.effects] == ["slip_sinkage"]
    assert kept.effects[0].parameters["n1"].sd > 0.0


def test_what_the_catalogue_lacks_is_not_named_with_confidence(tmp_path):
    _, folder = recorded(tmp_path, SEED + 20, ("inertia",), "plain", "bench")
    answer = explain(folder, catalogue=[slug for slug in SLUGS if slug != "inertia"])
    assert answer.verdict == "unknown"
    unknown = next(missing for missing in answer.missing if missing.effect == "unknown")
    assert "acceleration" in unknown.description
    assert "torque_Nm +=" in unknown.equation or "drawbar_pull_N +=" in unknown.equation


def test_an_unknown_effect_in_the_catalogue_is_refused(tmp_path):
    _, folder = recorded(tmp_path, SEED, ())
    with pytest.raises(InputError, match="phlogiston"):
        explain(folder, catalogue=["slip_sinkage", "phlogiston"])


@pytest.mark.parametrize("catalogue", [[], ["slope_gravity"]])
def test_where_nothing_can_be_tried_there_is_an_answer_all_the_same(tmp_path, catalogue):
    folder = conceal(7110, ("slip_sinkage",), "hidden", "steady").write(tmp_path)
    answer = explain(folder, catalogue=catalogue)
    assert answer.verdict == "unknown"
    assert [missing.effect for missing in answer.missing] == ["unknown"]
    # Faults that the catalogue lacks are weighed whatever is asked for of it.
    assert "unknown" in [candidate.effect for candidate in answer.candidates]
    assert {candidate.kind for candidate in answer.candidates} == {"unknown"}
    assert answer.heldout_nats.value > 15.0
    assert 0.0 < answer.heldout_nats.sd < answer.heldout_nats.value


@pytest.fixture(scope="module")
def null(tmp_path_factory) -> Path:
    return recorded(tmp_path_factory.mktemp("null"), SEED + 1, (), "plain", "bench")[1]


@pytest.fixture
def copy(null, tmp_path):
    """Copy the null with another wheel file."""

    def made(change) -> Path:
        folder = tmp_path / "copy"
        folder.mkdir()
        for name in ("recording.toml", "vehicle.toml", "wheel.csv"):
            (folder / name).write_bytes((null / name).read_bytes())
        return edited(folder, change)

    return made


def test_a_stretch_without_values_is_passed_over(copy):
    def blank(columns):
        columns["sinkage_m"][200:300] = math.nan
        columns["load_N"][400:450] = math.nan
        return columns

    answer = explain(copy(blank))
    assert answer.verdict == "none"
    assert any("50 rows without load or slip" in note for note in answer.notes)
    assert answer.fits["sinkage_m"].n < answer.fits["torque_Nm"].n


def test_a_channel_that_is_missing_is_not_compared(copy):
    answer = explain(copy(lambda columns: {k: v for k, v in columns.items() if k not in ("torque_Nm", "x_m")}))
    assert "torque_Nm" not in answer.fits
    assert answer.verdict == "none"


def test_a_channel_that_never_moves_is_left_out_and_said_so(copy):
    def stuck(columns):
        columns["sinkage_m"][:] = 0.02
        return columns

    answer = explain(copy(stuck))
    assert "sinkage_m" not in answer.fits
    assert any("sinkage_m never changes" in note for note in answer.notes)


def test_twenty_rows_get_an_answer(copy):
    answer = explain(copy(lambda columns: {name: values[::60] for name, values in columns.items()}))
    assert answer.n <= 20
    assert answer.verdict in ("none", "cannot_tell")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda columns: {k: v for k, v in columns.items() if k != "load_N"}, "load_N"),
        (lambda columns: {k: v[:4] for k, v in columns.items()}, "at least 5"),
        (lambda columns: {k: columns[k] for k in ("time_s", "load_N", "slip")}, "nothing to compare"),
        (lambda columns: columns | {"sinkage_m": 1e3 * columns["sinkage_m"]}, "the wheel's diameter"),
        (lambda columns: columns | {"time_s": np.floor(columns["time_s"])}, "time_s stands still in"),
    ],
    ids=["no load", "four rows", "no answer", "sinkage in millimetres", "whole seconds"],
)
def test_what_cannot_be_compared_is_refused_in_one_line(copy, change, said):
    with pytest.raises(InputError, match=said):
        explain(copy(change))


def test_a_soil_known_from_elsewhere_is_kept(tmp_path):
    made, folder = recorded(tmp_path, SEED + 30, ("rim_adhesion",), "hidden", "bench")
    free, known = explain(folder), explain(folder, soil=folder / "soil.toml")
    stated, sd = made.known_soil["c_Pa"]
    assert abs(known.soil["c_Pa"].value - stated) < 3.0 * sd
    assert known.soil["c_Pa"].sd <= free.soil["c_Pa"].sd
    assert "rim_adhesion" in names(known)


@pytest.mark.parametrize(("seed", "sure"), [(40, False), (42, True)])
def test_another_simulator_is_told_what_it_left_out(tmp_path, seed, sure):
    """The other simulator is the generator's own, on the true soil, without the effect that the recording has.

    Beside the first one's other form of slip-sinkage one more effect would gain just what makes an answer doubtful.
    """
    made, folder = recorded(tmp_path, SEED + seed, ("slip_sinkage",), "plain", "bench")
    case = made.case
    other, _ = simulate(case.ground, case.body, case.drive, ())
    names_of = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    columns = {"time_s": case.drive.time_s} | {name: getattr(other, name) for name in names_of}
    write_wheel_file(WheelTable(columns, None, None, tmp_path / "sim.csv"), tmp_path / "sim.csv")
    answer = explain(folder, simulated=tmp_path / "sim.csv")
    assert "slip_sinkage" in names(answer)
    assert answer.verdict == "physics" or not sure
    measured = made.recorded.columns["sinkage_m"]
    alone = float(np.sqrt(np.nanmean((measured - other.sinkage_m) ** 2)))
    assert answer.fits["sinkage_m"].rmse_before == pytest.approx(alone, rel=0.02), "before is the other simulator"
    assert answer.fits["sinkage_m"].rmse_after < 0.8 * alone


def test_the_answer_is_json_and_the_same_each_time(null):
    first, second = to_json(explain(null)), to_json(explain(null))
    for page in (first, second):
        page.pop("seconds")
    text = json.dumps(first, allow_nan=False)
    assert json.loads(text) == second
    assert {"schema", "verdict", "summary", "located", "missing", "candidates", "fit"} <= set(first)
