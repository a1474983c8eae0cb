"""The scorer of explanations, on answers made by hand, and the tables of the study."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from concealed import summary
from concealed.effects import catalogue
from concealed.scorer import COMPARABLE, score, score_left_out

SLIP_SINKAGE = {
    "effect": "slip_sinkage", "kind": "physics", "form": "exponent", "parameters": {"n1": 0.2},
    "channels": ["sinkage_m", "torque_Nm"], "variables": ["slip"],
}  # fmt: skip
OFFSET = {
    "effect": "torque_offset", "kind": "instrument", "form": "constant", "parameters": {"offset_Nm": -0.5},
    "channels": ["torque_Nm"], "variables": ["constant"],
}  # fmt: skip
PATCH = {
    "effect": "soil_patch", "kind": "physics", "form": "sharp", "parameters": {"from_m": 1.0, "to_m": 2.0},
    "channels": ["torque_Nm"], "variables": ["x_m"], "places": {"x_m": [1.0, 2.0]},
}  # fmt: skip


def truth(*effects) -> dict:
    return {
        "seed": 7, "level": "hidden" if effects else "null", "protocol": "bench", "reached": True,
        "effects": list(effects), "oracle_rmse": {"torque_Nm": 0.1, "sinkage_m": 0.001},
    }  # fmt: skip


def said(effect, probability=0.95, kind="physics", like=(), **parameters) -> dict:
    return {
        "effect": effect, "kind": kind, "probability": probability, "indistinguishable_from": list(like),
        "parameters": parameters,
    }  # fmt: skip


def answer(verdict, *missing, located=(), after=None) -> dict:
    channels = {name: {"rmse_before": 1.0, "rmse_after": value} for name, value in (after or {}).items()}
    return {
        "schema": 1, "verdict": verdict, "missing": list(missing), "located": list(located),
        "fit": {"channels": channels}, "seconds": 12.0,
    }  # fmt: skip


def test_a_right_name_with_a_right_parameter():
    place = {"channel": "sinkage_m", "variable": "slip", "from": 0.3, "to": 0.6, "share": 0.7, "p_value": 1e-9}
    n1 = {"value": 0.21, "sd": 0.02}
    found = score(
        truth(SLIP_SINKAGE),
        answer("physics", said("slip_sinkage", n1=n1), located=[place], after={"torque_Nm": 0.105, "sinkage_m": 0.001}),
    )
    assert found["named"]
    assert found["kind_right"]
    assert not found["indistinguishable"]
    assert not found["falsely_named"]
    assert found["located_channel"]
    assert found["located_variable"]
    assert found["intervals"] == [True]
    assert found["error_ratio"] == {"torque_Nm": pytest.approx(1.05), "sinkage_m": pytest.approx(1.0)}
    assert found["statements"] == [(0.95, True)]
    assert found["seconds"] == 12.0
    assert found["false_alarm"] is None


def test_an_interval_that_misses_and_a_name_of_another_program():
    n1 = {"value": 0.30, "sd": 0.02}
    assert score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", n1=n1)))["intervals"] == [False]
    other = answer("physics", said("slip_sinkage", growth=n1))
    assert score(truth(SLIP_SINKAGE), other)["intervals"] == []
    assert score(truth(SLIP_SINKAGE), other, same={"slip_sinkage.n1": "growth"})["intervals"] == [False]
    asymmetric = {**n1, "low": 0.19, "high": 0.5}
    assert score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", n1=asymmetric)))["intervals"] == [True]


def test_indistinguishable_counts_where_the_truth_is_among_them():
    found = score(truth(SLIP_SINKAGE), answer("physics", said("stress_peak_shift", 0.5, like=["slip_sinkage"])))
    assert found["named"]
    assert found["indistinguishable"]
    assert not found["falsely_named"]
    assert found["statements"] == [(0.5, False)]
    undecided = answer("cannot_tell", said("slip_sinkage", 0.6), said("exit_angle", 0.4))
    found = score(truth(SLIP_SINKAGE), undecided)
    assert found["named"]
    assert found["indistinguishable"]
    assert found["kind_right"]


def test_naming_everything_names_nothing():
    everything = [said(slug, 1.0 / 23.0) for slug in catalogue()]
    assert not score(truth(SLIP_SINKAGE), answer("cannot_tell", *everything))["named"]
    wide = said("exit_angle", 0.2, like=list(catalogue()))
    assert not score(truth(SLIP_SINKAGE), answer("physics", wide))["named"]


def test_a_wrong_name_is_wrong_alone_and_beside_the_right_one():
    alone = score(truth(OFFSET), answer("physics", said("exit_angle")))
    assert not alone["named"]
    assert alone["falsely_named"]
    assert alone["kind_right"] is False
    beside = answer("instrument", said("torque_offset", kind="instrument"), said("drift", kind="instrument"))
    assert not score(truth(OFFSET), beside)["named"]
    assert score(truth(OFFSET), beside)["falsely_named"]
    assert score(truth(OFFSET), beside)["kind_right"]


@pytest.mark.parametrize(("share", "first"), [(0.6, True), (0.3, False)])
def test_an_undecided_answer_tells_the_kind_by_its_most_probable_name_only(share, first):
    undecided = answer(
        "cannot_tell", said("drivetrain_friction", 0.9 - share), said("torque_offset", share, "instrument")
    )
    found = score(truth(OFFSET), undecided)
    assert found["kind_right"] is False
    assert found["first_kind_right"] is first


def test_what_was_not_found_is_not_named_and_tells_no_kind():
    found = score(truth(OFFSET), answer("none"))
    assert found["named"] is False
    assert found["falsely_named"] is False
    assert found["kind_right"] is None
    assert found["located_channel"] is False


def test_nulls_ask_for_none():
    assert score(truth(), answer("none"))["false_alarm"] is False
    for verdict in ("physics", "instrument", "unknown", "cannot_tell"):
        assert score(truth(), answer(verdict))["false_alarm"] is True
    assert score(truth(), answer("none"))["named"] is None
    assert score(truth(), None)["false_alarm"] is None


def test_pairs_count_both():
    pair = truth(SLIP_SINKAGE, OFFSET)
    both = score(pair, answer("physics", said("slip_sinkage"), said("torque_offset", kind="instrument")))
    assert both["both_named"]
    assert both["named_count"] == 2
    assert both["kind_right"] is None
    one = score(pair, answer("physics", said("slip_sinkage")))
    assert one["named"]
    assert not one["both_named"]


def test_a_patch_is_found_where_it_lies():
    def located(low, high):
        return {"channel": "torque_Nm", "variable": "x_m", "from": low, "to": high, "share": 0.9}

    right = answer("physics", said("soil_patch"), located=[located(1.1, 2.2)])
    wrong = answer("physics", said("soil_patch"), located=[located(2.5, 3.0)])
    assert score(truth(PATCH), right)["located_interval"]
    assert not score(truth(PATCH), wrong)["located_interval"]
    assert score(truth(SLIP_SINKAGE), right)["located_interval"] is None
    assert score(truth(PATCH), answer("none"))["located_interval"] is False


def test_a_failure_is_nothing_right():
    found = score(truth(OFFSET), None)
    assert found["failed"]
    assert found["named"] is False
    assert found["intervals"] == []


def test_without_its_entry_only_a_confident_name_is_wrong():
    hidden = truth(SLIP_SINKAGE)
    assert score_left_out(hidden, answer("unknown"))["right"]
    assert score_left_out(hidden, answer("cannot_tell", said("exit_angle", 0.6), said("hard_layer", 0.4)))["right"]
    assert score_left_out(hidden, answer("physics", said("exit_angle", 0.4)))["right"]
    confident = score_left_out(hidden, answer("physics", said("exit_angle", 0.9)))
    assert confident["confident_wrong"]
    assert not confident["right"]
    silent = score_left_out(hidden, answer("none"))
    assert silent["silent"]
    assert not silent["right"]
    assert score_left_out(hidden, None)["failed"]


def test_comparable_parameters_are_those_that_effects_have():
    kinds = catalogue()
    for (slug, form), names in COMPARABLE.items():
        assert form in kinds[slug].forms
        effect = kinds[slug](form, 0.1)
        assert set(names) <= set(effect.parameters()), slug


def test_shares_have_wilsons_interval():
    share, low, high = summary.wilson(49, 50)
    assert share == 0.98
    assert (low, high) == (pytest.approx(0.8950, abs=1e-4), pytest.approx(0.9965, abs=1e-4))
    assert summary.wilson(0, 10)[1] == 0.0
    with pytest.raises(ValueError, match="nothing"):
        summary.wilson(0, 0)


def test_the_bootstrap_holds_the_median(rng):
    median, low, high = summary.bootstrap_median(rng.normal(5.0, 1.0, 200).tolist())
    assert low < median < high
    assert high - low == pytest.approx(2.0 * 1.96 * 1.2533 / np.sqrt(200.0), rel=0.4)


def test_calibration_compares_stated_and_right():
    statements = [(0.95, True)] * 9 + [(0.95, False)] + [(1.0, True)] * 3
    rows = summary.calibration(statements)
    assert [(row["from"], row["count"], row["right"]) for row in rows] == [(0.9, 10, 0.9), (0.97, 3, 1.0)]


def test_tables_count_what_was_scored():
    n1 = {"value": 0.21, "sd": 0.02}
    scores = [
        score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", n1=n1), after={"torque_Nm": 0.11})),
        score(truth(SLIP_SINKAGE), answer("physics", said("exit_angle"))),
        score(truth(), answer("none")),
        score(truth(SLIP_SINKAGE, OFFSET), answer("physics", said("slip_sinkage"))),
        score(truth(OFFSET), None),
    ]
    scores[1]["rivals"] = {"exit_angle": 2.0, "drift": 90.0}
    text = summary.table(scores)
    assert "| named right, hidden | 33.3 %" in text
    assert "1 of 3" in text
    assert "| named right, plain | - |" in text
    assert "| false alarm on nulls | 0.0 %" in text
    assert "| both of a pair named | 0.0 %" in text
    assert "| not named, and another effect fits as well (within 4 nats) | 100.0 %" in text
    assert "| failures | 20.0 %" in text
    assert "| `slip_sinkage` | 1 of 2 | exit_angle (1) |" in summary.by_effect(scores)
    assert "| 0.9 to 0.97 |" in summary.calibration_table(scores)
    assert "| confident wrong name | 100.0 %" in summary.left_out_table(
        [score_left_out(truth(OFFSET), answer("physics", said("exit_angle")))]
    )


@pytest.fixture(scope="module")
def study():
    path = Path(__file__).resolve().parents[2] / "docs" / "studies" / "concealed_physics.py"
    spec = importlib.util.spec_from_file_location("concealed_physics", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_study_draws_nulls_pairs_and_every_effect(study):
    drawn = [study.draw(seed, False) for seed in range(400)]
    hidden = [effects for effects, _, _ in drawn]
    assert np.mean([not effects for effects in hidden]) == pytest.approx(0.30, abs=0.01)
    assert np.mean([len(effects) == 2 for effects in hidden]) == pytest.approx(0.15, abs=0.01)
    assert {effects[0] for effects in hidden if len(effects) == 1} == set(catalogue())
    assert {study.draw(seed, True)[0][0] for seed in range(23)} == set(catalogue())


def test_the_study_asks_scores_and_goes_on_where_it_stopped(study, monkeypatch, tmp_path, capsys):
    """With a tool that answers "none": the folder it is given holds the recording alone."""
    import bevameter

    asked = []

    def explain(folder, **options):
        asked.append((sorted(path.name for path in Path(folder).iterdir()), options))
        return answer("none")

    monkeypatch.setattr(bevameter, "explain", explain, raising=False)
    monkeypatch.setattr("bevameter.identification.mismatch.explanation.to_json", dict)
    monkeypatch.setattr(study, "draw", lambda seed, left_out, asked: ((), "hidden", asked or "steady"))
    out = tmp_path / "out.jsonl"
    command = ["concealed_physics.py", "--recordings", "3", "--processes", "1", "--out", str(out)]
    monkeypatch.setattr("sys.argv", command)
    study.main()
    assert [names for names, _ in asked] == [["recording.toml", "vehicle.toml", "wheel.csv"]] * 3
    assert "| false alarm on nulls | 0.0 %" in capsys.readouterr().out
    lines = out.read_text().splitlines()
    assert [json.loads(line)["seed"] for line in lines] == [0, 1, 2]
    out.write_text("\n".join(lines[:2]) + '\n{"seed": 2, "hid')  # cut off while the last line was written
    study.main()
    assert len(asked) == 4
    assert set(study.done(out)) == {0, 1, 2}
    for protocol in ("ramps", "turns"):
        others = tmp_path / f"{protocol}.jsonl"
        monkeypatch.setattr("sys.argv", [*command[:-1], str(others), "--protocol", protocol])
        study.main()
        assert {score["protocol"] for score in study.done(others).values()} == {protocol}


def test_a_protocol_that_cannot_show_what_is_hidden_gives_way_to_a_bench_test(study):
    drawn = [study.draw(seed, False, "ramps") for seed in range(60)]
    assert {protocol for _, _, protocol in drawn} == {"bench", "ramps"}
    assert all(("inertia" in effects) is (protocol == "bench") for effects, _, protocol in drawn)
    # Nothing else hangs on what is asked for.
    assert [row[:2] for row in drawn] == [study.draw(seed, False)[:2] for seed in range(60)]


def test_a_tool_that_breaks_is_counted(study, monkeypatch, tmp_path):
    import bevameter

    def explain(folder, **options):
        raise RuntimeError("no idea")

    monkeypatch.setattr(bevameter, "explain", explain, raising=False)
    monkeypatch.setattr(study, "draw", lambda seed, left_out, asked: (("sinkage_offset",), "plain", "steady"))
    row = study.one((1, True, False, None))
    assert row["failed"]
    assert row["failure"] == "RuntimeError: no idea"
    json.dumps(row)
