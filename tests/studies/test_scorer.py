"""The scorer of explanations, on prepared answers, and the table of many scores."""

from __future__ import annotations

import pytest
from concealed.effects import catalogue
from concealed.truth import COMPARABLE
from judging import summary
from judging.scorer import score

SLIP_SINKAGE = {
    "effect": "slip_sinkage", "kind": "physics", "form": "exponent", "comparable": {"n1": 0.2},
    "channels": ["sinkage_m", "torque_Nm"], "variables": ["slip"],
}  # fmt: skip
OFFSET = {
    "effect": "torque_offset", "kind": "instrument", "form": "constant", "comparable": {"T_0": -0.5},
    "channels": ["torque_Nm"], "variables": ["constant"],
}  # fmt: skip
PATCH = {
    "effect": "soil_patch", "kind": "physics", "form": "sharp",
    "channels": ["torque_Nm"], "variables": ["x_m"], "places": {"x_m": [1.0, 2.0]},
}  # fmt: skip
BEYOND = {"effect": "beyond", "kind": "physics"}


def truth(*effects) -> dict:
    return {
        "level": "hidden" if effects else "null", "reached": True,
        "effects": list(effects), "oracle_rmse": {"torque_Nm": 0.1, "sinkage_m": 0.001},
    }  # fmt: skip


def said(effect, probability=0.95, kind="physics", like=(), **parameters) -> dict:
    return {
        "effect": effect, "kind": kind, "form": "", "probability": probability, "indistinguishable_from": list(like),
        "parameters": parameters,
    }  # fmt: skip


def answer(verdict, *missing, located=(), after=None) -> dict:
    channels = {name: {"rmse_before": 1.0, "rmse_after": value} for name, value in (after or {}).items()}
    return {
        "schema": 1, "verdict": verdict, "missing": list(missing), "located": list(located),
        "fit": {"channels": channels},
    }  # fmt: skip


def test_a_right_name_with_a_right_parameter():
    place = {"channel": "sinkage_m", "variable": "slip", "from": 0.3, "to": 0.6, "share": 0.7, "p_value": 1e-9}
    n1 = {"value": 0.21, "sd": 0.02}
    found = score(
        truth(SLIP_SINKAGE),
        answer("physics", said("slip_sinkage", n1=n1), located=[place], after={"torque_Nm": 0.105, "sinkage_m": 0.001}),
        seconds=12.0,
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


def test_intervals_are_of_parameters_that_mean_the_same():
    n1 = {"value": 0.30, "sd": 0.02}
    assert score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", n1=n1)))["intervals"] == [False]
    assert score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", p=n1)))["intervals"] == []
    asymmetric = {**n1, "low": 0.19, "high": 0.5}
    assert score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", n1=asymmetric)))["intervals"] == [True]
    assert score(truth(SLIP_SINKAGE), answer("cannot_tell", said("slip_sinkage", n1=n1)))["intervals"] == []
    late = {"effect": "time_lag", "kind": "instrument", "comparable": {"tau": 0.2}}
    for form, held in (("delay of torque_Nm", [True]), ("low-pass of torque_Nm", [])):
        named = said("time_lag", kind="instrument", tau={"value": 0.2, "sd": 0.01}) | {"form": form}
        assert score(truth(late), answer("instrument", named))["intervals"] == held


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


def test_a_wrong_name_is_wrong_alone_and_together_with_the_right_one():
    alone = score(truth(OFFSET), answer("physics", said("exit_angle")))
    assert not alone["named"]
    assert alone["falsely_named"]
    assert alone["kind_right"] is False
    both = answer("instrument", said("torque_offset", kind="instrument"), said("drift", kind="instrument"))
    assert not score(truth(OFFSET), both)["named"]
    assert score(truth(OFFSET), both)["falsely_named"]
    assert score(truth(OFFSET), both)["kind_right"]


@pytest.mark.parametrize(("share", "first"), [(0.6, True), (0.3, False)])
def test_an_undecided_answer_has_the_kind_of_its_most_probable_name(share, first):
    undecided = answer(
        "cannot_tell", said("drivetrain_friction", 0.9 - share), said("torque_offset", share, "instrument")
    )
    found = score(truth(OFFSET), undecided)
    assert found["kind_right"] is False
    assert found["first_kind_right"] is first


def test_an_effect_that_is_not_found_is_not_named_and_has_no_kind():
    found = score(truth(OFFSET), answer("none"))
    assert found["named"] is False
    assert found["falsely_named"] is False
    assert found["kind_right"] is None
    assert found["located_channel"] is False


def test_anything_found_in_a_null_is_a_false_alarm():
    assert score(truth(), answer("none"))["false_alarm"] is False
    for verdict in ("physics", "instrument", "unknown", "cannot_tell"):
        assert score(truth(), answer(verdict))["false_alarm"] is True
    assert score(truth(), answer("none"))["named"] is None
    assert score(truth(), None)["false_alarm"] is None


def test_pairs_count_both():
    pair = truth(SLIP_SINKAGE, OFFSET)
    both = score(pair, answer("physics", said("slip_sinkage"), said("torque_offset", kind="instrument")))
    assert both["both_named"]
    assert both["kind_right"] is None
    one = score(pair, answer("physics", said("slip_sinkage")))
    assert one["named"]
    assert not one["both_named"]


def test_the_unknown_is_no_name():
    """An unknown effect with a right name does no harm; an answer "unknown" names nothing, whatever it lists."""
    unknown = said("unknown", 0.6, "unknown")
    both = score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage"), unknown))
    assert both["named"]
    assert not both["falsely_named"]
    mentioned = score(truth(SLIP_SINKAGE), answer("unknown", said("slip_sinkage", 0.3), unknown))
    assert mentioned["named"] is False
    assert mentioned["falsely_named"] is False
    assert mentioned["statements"] == [(0.3, True), (0.6, False)]


def test_a_patch_is_found_where_it_lies():
    def located(low, high):
        return {"channel": "torque_Nm", "variable": "x_m", "from": low, "to": high, "share": 0.9}

    right = answer("physics", said("soil_patch"), located=[located(1.1, 2.2)])
    wrong = answer("physics", said("soil_patch"), located=[located(2.5, 3.0)])
    assert score(truth(PATCH), right)["located_interval"]
    assert not score(truth(PATCH), wrong)["located_interval"]
    assert score(truth(SLIP_SINKAGE), right)["located_interval"] is None
    assert score(truth(PATCH), answer("none"))["located_interval"] is False


def test_a_failure_counts_as_nothing_right():
    found = score(truth(OFFSET), None)
    assert found["failed"]
    assert found["named"] is False
    assert found["intervals"] == []


@pytest.mark.parametrize(("hidden", "left_out"), [(SLIP_SINKAGE, True), (BEYOND, False)])
def test_where_the_catalogue_lacks_the_cause_only_a_confident_name_is_wrong(hidden, left_out):
    def scored(*given):
        return score(truth(hidden), answer(*given), left_out=left_out)

    assert scored("unknown", said("unknown", 0.9, "unknown"))["confident_wrong"] is False
    assert scored("unknown", said("exit_angle", 0.9))["confident_wrong"] is False
    assert scored("cannot_tell", said("exit_angle", 0.8), said("hard_layer", 0.2))["confident_wrong"] is False
    assert scored("physics", said("exit_angle", 0.79))["confident_wrong"] is False
    confident = scored("physics", said("exit_angle", 0.8))
    assert confident["confident_wrong"] is True
    assert confident["silent"] is False
    assert confident["named"] is None
    assert scored("none")["silent"] is True
    assert scored("none")["confident_wrong"] is False


def test_with_a_cause_beyond_the_catalogue_the_other_one_may_be_named():
    both = truth(OFFSET, BEYOND)
    right = said("torque_offset", kind="instrument")
    assert score(both, answer("instrument", right))["confident_wrong"] is False
    assert score(both, answer("instrument", right, said("drift", kind="instrument")))["confident_wrong"] is True
    unknown = score(truth(BEYOND), answer("unknown", said("unknown", 0.9, "unknown")))
    assert unknown["statements"] == [(0.9, True)]


def test_a_truth_without_places_and_an_oracle_is_scored():
    bare = {"level": "plain", "effects": [{"effect": "slip_sinkage", "kind": "physics"}]}
    found = score(bare, answer("physics", said("slip_sinkage"), after={"torque_Nm": 0.1}))
    assert found["named"]
    assert found["located_channel"] is None
    assert found["error_ratio"] == {}
    assert found["intervals"] == []


DRIVE = {
    "level": "hidden", "reached": True,
    "grounds": [
        {"class": "sand", "start_s": 0.0, "end_s": 60.0, "soil": {"c_Pa": 300.0, "phi_rad": 0.5}},
        {"class": "clay", "start_s": 60.0, "end_s": 120.0, "soil": {"c_Pa": 4000.0, "phi_rad": 0.2}},
        {"class": "sand", "start_s": 120.0, "end_s": 200.0, "soil": {"c_Pa": 900.0, "phi_rad": 0.6}},
    ],
}  # fmt: skip


def drive(*effects) -> dict:
    return {**DRIVE, "level": "hidden" if effects else "null", "effects": list(effects)}


def there(effect, where, belongs_to="ground") -> dict:
    return {**effect, "where": where, "belongs_to": belongs_to}


@pytest.mark.parametrize(
    ("where", "said_where", "right"),
    [
        ("everywhere", "", True),
        ("everywhere", "by class", True),
        ("everywhere", "on sand only", False),
        ({"class": "sand"}, "on sand only", True),
        ({"class": "sand"}, "on clay only", False),
        ({"class": "sand"}, "", False),
        ({"class": "sand"}, "by class", False),
        ({"wheel": "front_left"}, "on front_left only", True),
        ({"wheel": "front_left"}, "on front_right only", False),
    ],
)
def test_where_a_cause_acts(where, said_where, right):
    told = said("slip_sinkage") | {"where": said_where, "belongs_to": "ground"}
    found = score(drive(there(SLIP_SINKAGE, where)), answer("physics", told))
    kind = where if isinstance(where, str) else next(iter(where))
    assert found["where_right"] == [(kind, right)]
    assert found["acts_on"] == kind
    less = said("slip_sinkage", 0.1) | {"where": "on gravel only"}
    assert score(drive(there(SLIP_SINKAGE, where)), answer("physics", less, told))["where_right"] == [(kind, right)]
    assert score(drive(there(SLIP_SINKAGE, where)), answer("none"))["where_right"] == []


def test_what_a_cause_belongs_to_is_that_of_the_most_probable_name():
    hidden = there(OFFSET, {"wheel": "front"}, "vehicle")
    ground = said("exit_angle", 0.3) | {"belongs_to": "ground"}
    vehicle = said("inertia", 0.6) | {"belongs_to": "vehicle"}
    assert score(drive(hidden), answer("cannot_tell", ground, vehicle))["belongs_right"] is True
    assert score(drive(hidden), answer("physics", ground))["belongs_right"] is False
    assert score(drive(hidden), answer("none"))["belongs_right"] is None
    assert score(drive(hidden, there(SLIP_SINKAGE, "everywhere")), answer("physics", ground))["belongs_right"] is None


def test_the_soil_of_each_ground_is_that_of_its_place():
    def ground(name, start, end, c, phi):
        return {
            "class": name, "start_s": start, "end_s": end,
            "soil": {"c_Pa": {"value": c, "sd": 100.0}, "phi_rad": {"value": phi, "sd": 0.01}},
        }  # fmt: skip

    # The first ground begins, and the last one ends, where the drive does; one ground was not used.
    grounds = [ground("sand", None, 60.5, 150.0, 0.5), ground("sand", 121.0, None, 950.0, 0.55)]
    none = {**answer("none"), "grounds": grounds}
    assert score(drive(), none)["soil_intervals"] == {"c_Pa": [True, True], "phi_rad": [True, False]}
    wrong = {**answer("physics", said("exit_angle")), "grounds": grounds}
    hidden = there(SLIP_SINKAGE, "everywhere")
    assert score(drive(hidden), wrong)["soil_intervals"] == {}
    right = {**answer("physics", said("slip_sinkage")), "grounds": grounds}
    assert score(drive(hidden), right)["soil_intervals"]["c_Pa"] == [True, True]
    assert score(drive(), answer("none"))["soil_intervals"] == {"c_Pa": [], "phi_rad": []}
    assert score(truth(SLIP_SINKAGE), right)["of_drive"] is False
    assert score(drive(), None)["soil_intervals"] == {"c_Pa": [], "phi_rad": []}


def test_the_table_has_the_measures_of_drives_where_there_are_some():
    told = said("slip_sinkage") | {"where": "on sand only", "belongs_to": "ground"}
    scores = [
        score(drive(there(SLIP_SINKAGE, {"class": "sand"})), answer("physics", told)),
        score(drive(there(SLIP_SINKAGE, "everywhere")), answer("physics", told)),
        score(drive(), answer("none")),
    ]
    found = summary.measures(scores)
    assert "1 of 1" in found["named right, on one class"]
    assert "1 of 1" in found["where it acts told right, on one class, of those named"]
    assert "0 of 1" in found["where it acts told right, everywhere, of those named"]
    assert "2 of 2" in found["ground or vehicle right, by the most probable name"]
    assert found["c_Pa of a ground in its interval, nulls"] == "-"
    assert "named right, on one class" not in summary.measures([score(truth(), answer("none"))])


def test_comparable_parameters_are_those_that_effects_have():
    kinds = catalogue()
    for (slug, form), names in COMPARABLE.items():
        assert form in kinds[slug].forms
        effect = kinds[slug](form, 0.1)
        assert {own for own, _ in names.values()} <= set(effect.parameters()), slug


def test_shares_have_wilsons_interval():
    assert summary.share([True] * 49 + [False]) == "98.0 % (89.5-99.6; 49 of 50)"
    assert summary.share([False] * 10).startswith("0.0 % (0.0-")
    assert summary.share([]) == "-"


def test_quantiles_have_the_interval_of_order_statistics():
    assert summary.quantile(list(range(1, 101)), 0.5) == "50.5 (40-61)"
    assert summary.quantile([1.0, 2.0, 3.0], 0.5).endswith("(-)")
    assert summary.quantile([], 0.5) == "-"


def test_calibration_compares_stated_and_right():
    rows = summary.calibration([(0.9, True)] * 9 + [(0.9, False)] + [(0.95, True)] * 2 + [(1.0, True)])
    assert rows["right where 0.85 to 0.95 was stated"].startswith("90.0 %")
    assert "3 of 3" in rows["right where 0.95 to 1 was stated"]
    assert rows["right where 0 to 0.5 was stated"] == "-"


def test_the_table_counts_what_was_scored():
    n1 = {"value": 0.21, "sd": 0.02}
    scores = [
        score(truth(SLIP_SINKAGE), answer("physics", said("slip_sinkage", n1=n1), after={"torque_Nm": 0.11}), 10.0),
        score(truth(SLIP_SINKAGE), answer("physics", said("exit_angle")), 30.0),
        score(truth(), answer("none"), 2.0),
        score(truth(SLIP_SINKAGE, OFFSET), answer("physics", said("slip_sinkage"))),
        score(truth(OFFSET), None),
        score(truth(BEYOND), answer("physics", said("exit_angle"))),
        score(truth(SLIP_SINKAGE), answer("unknown"), left_out=True),
    ]
    found = summary.measures(scores)
    assert found["named right, hidden"].startswith("33.3 %")
    assert found["named right, plain"] == "-"
    assert "0 of 1" in found["false alarm on nulls"]
    assert "0 of 1" in found["both of a pair named"]
    assert "1 of 1" in found["at least one of a pair named"]
    assert "1 of 4" in found["falsely named, in addition or instead"]
    assert "1 of 1" in found["confident wrong name (from 0.8), cause beyond the catalogue"]
    assert "0 of 1" in found["confident wrong name (from 0.8), effect left out of the catalogue"]
    assert "1 of 1" in found["parameter's interval holds the truth"]
    assert "2 of 4" in found["right where 0.95 to 1 was stated"]
    assert found["held-out error over the oracle's, median"].startswith("1.1 ")
    assert found["seconds, most"] == "30"
    assert "1 of 7" in found["failures"]
    text = summary.table({"one": scores, "two": scores[:2]})
    assert "| recordings | 7 | 2 |" in text
    lines = summary.each(dict(zip("abcdefg", scores, strict=True))).splitlines()[2:]
    assert lines[1] == "| b | single | hidden | slip_sinkage | physics | exit_angle 0.95 | False | 30 |"
    assert [line.split(" | ")[6] for line in lines] == ["True", "False", "True", "True", "False", "False", "True"]
