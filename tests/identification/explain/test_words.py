"""The answer in words: what is missing, how sure that is, what to do, for every verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from bevameter.identification.explain.explanation import Estimate, Missing, Region
from bevameter.identification.explain.quantities import percent
from bevameter.identification.explain.words import above_noise, details, headline, predicted_worse, summarise, trust
from explanations import ROWS, cannot_tell, explanation, nothing, several, unknown


def missed(answer, times: float = 3.0, **changes):
    """The same answer with torque and sinkage predicted worse than their noise."""
    fits = dict(answer.fits)
    for name in ("torque_Nm", "sinkage_m"):
        error = times * fits[name].noise
        fits[name] = replace(fits[name], rmse_before=error, rmse_after=error)
    return replace(answer, fits=fits, **changes)


def test_physics_is_named_first_with_its_probability_and_what_modelling_it_gains():
    said = summarise(explanation())
    assert said.startswith("Missing: slip-sinkage (98 %).")
    for each in ("n1 = 0.213 ± 0.019", "from 2.8 to 0.51 mm (the noise) in sinkage", "slip from 0.3 to 0.55"):
        assert each in said, each
    assert "from 1.2 to 0.52 N m" in said


def test_physics_and_faults_are_named_apart_and_what_is_doubtful_is_not_asserted():
    first, second, third = (part for part in headline(several()).split(". "))
    assert first == "Missing: slip-sinkage (98 %)"
    assert second == "Fault: time lag of the torque (97 %)"
    assert "load gain (30 %)" in third
    assert "weigh it" in details(several()), "what decides about the doubtful one"


def test_an_instrument_alone_is_a_fault():
    fault = replace(several().missing[1], effect="sinkage_offset", form="")
    said = headline(explanation(verdict="instrument", missing=(fault,)))
    assert said == "Fault: sinkage offset (97 %)."


def test_causes_that_are_not_separated_are_followed_by_the_measurement_that_separates_them():
    answer = cannot_tell()
    causes, _, measurement = headline(answer).partition(": ")
    assert measurement == f"{answer.missing[0].would_tell}."
    assert "side-wall friction (55 %) and torque gain (42 %)" in causes
    assert answer.missing[0].would_tell not in details(answer), "said once"
    one = replace(answer, missing=answer.missing[:1])
    assert "side-wall friction (55 %)" in headline(one)
    assert one.missing[0].would_tell in headline(one)
    likely = tuple(replace(each, probability=0.75) for each in answer.missing)
    assert "several" in headline(replace(answer, missing=likely)), "shares above one: both may be missing"
    undecided = tuple(replace(each, would_tell="") for each in answer.missing)
    assert ": " not in headline(replace(answer, missing=undecided)), "nothing is proposed that separates nothing"


def test_the_unknown_says_where_it_lives_and_what_is_asserted_with_it():
    said = summarise(unknown())
    assert said.startswith("Missing: something that the catalogue lacks (93 %).")
    assert "torque T differs by 3 times its noise, mostly with rim speed" in said.replace("Torque", "torque")
    assert "vary rim speed with all else held constant" in said
    assert "_" not in said
    both = replace(unknown(), missing=(*unknown().missing, *explanation().missing))
    assert "slip-sinkage (98 %)" in headline(both)
    assert "something that the catalogue lacks (93 %)" in headline(both)


def test_nothing_missing_counts_the_rows_and_says_no_more():
    said = summarise(replace(nothing(), n=1200))
    assert said == headline(replace(nothing(), n=1200))
    assert "1,200 rows" in said
    assert "within noise" in said
    assert "few" not in said
    assert "only a large effect" in headline(replace(nothing(), n=6))


def test_nothing_found_is_not_agreement_where_errors_stay_above_the_noise():
    said = headline(missed(nothing()))
    assert "3 times the noise in torque and 3 times the noise in sinkage" in said
    assert "drawbar pull" not in said
    assert "agrees" not in said
    assert list(above_noise(missed(nothing()))) == ["torque_Nm", "sinkage_m"]


def test_another_simulator_on_another_soil_does_not_agree():
    fits = {name: replace(fit, rmse_before=4.0 * fit.rmse_after) for name, fit in nothing().fits.items()}
    said = headline(replace(nothing(), fits=fits))
    assert "soil" in said
    assert "torque, sinkage and drawbar pull" in said


def test_parameters_are_relied_on_only_where_all_is_certain_and_within_noise():
    certain = trust(explanation())
    assert "within noise" in certain
    assert certain != trust(several())
    for doubted in (several(), cannot_tell(), unknown(), missed(explanation()), missed(nothing())):
        assert "another form" in trust(doubted)
    assert "times the noise" in trust(missed(explanation()))


def test_a_channel_that_is_predicted_worse_is_said_so():
    fits = {**explanation().fits, "torque_Nm": replace(explanation().fits["torque_Nm"], rmse_before=0.4)}
    worse = explanation(fits=fits)
    assert predicted_worse(worse) == ["torque"]
    assert "rises from 0.4 to 0.52 N m" in details(worse)
    assert "another form" in trust(worse)
    assert predicted_worse(explanation()) == []
    assert predicted_worse(replace(nothing(), fits=fits)) == [], "nothing was added that could be worse"


def test_the_model_is_named_where_it_is_not_what_is_asserted():
    assert "exponent" not in details(explanation())
    assert "slip-sinkage (exponent)" in details(cannot_tell())
    assert "smooth discrepancy" in details(unknown())


@pytest.mark.parametrize(
    ("region", "said"),
    [
        (Region("sinkage_m", "constant", 2e-3, 3e-3, 1.0, 1e-9, 5.0), "constant 2 to 3 mm"),
        (Region("torque_Nm", "lag_s", 0.2, 0.3, 1.0, 1e-9, 5.0), "delay of 0.2 to 0.3 s"),
        (Region("torque_Nm", "wheel_angle_rad", 0.0, math.pi / 6.0, 1.0, 1e-9, 5.0), "12 cycles a turn"),
        (Region("torque_Nm", "pitch_rad", 0.0, math.radians(10.0), 1.0, 1e-9, -5.0), "is below the simulated"),
        (Region("torque_Nm", "pitch_rad", 0.0, math.radians(10.0), 1.0, 1e-9, math.nan), "0 to 10 deg"),
    ],
)
def test_the_place_of_the_difference_is_said_in_the_units_of_its_variable(region, said):
    assert said in details(explanation(located=(region,)))
    assert "nan" not in details(explanation(located=(region,)))


@pytest.mark.parametrize(("count", "said"), [(3, "d2 = 0.50 ± 0.10"), (4, "1 more"), (6, "3 more")])
def test_parameters_beyond_the_first_few_are_counted(count, said):
    values = {f"d{number}": Estimate(0.5, 0.1) for number in range(count)}
    drift = Missing("drift", "instrument", "torque_Nm", 0.9, values, "", "")
    text = details(explanation(missing=(drift,)))
    assert said in text
    assert ("more" in text) == (count > 3)


@pytest.mark.parametrize(
    ("probability", "text"),
    [
        (1.0, "> 99.5 %"), (0.995, "> 99.5 %"), (0.994, "99 %"), (0.95, "95 %"), (0.006, "1 %"), (0.005, "< 0.5 %"),
        (0.0, "< 0.5 %"), (math.nan, "unknown"),
    ],
)  # fmt: skip
def test_a_probability_is_never_given_as_certain(probability, text):
    assert percent(probability) == text


def test_numbers_that_are_not_known_are_no_error():
    nan = math.nan
    fits = {
        name: replace(fit, rmse_before=nan, rmse_after=nan, noise=nan, before_interval=(nan, nan))
        for name, fit in explanation().fits.items()
    }
    missing = (replace(explanation().missing[0], parameters={"n1": Estimate(nan, nan)}),)
    assert "n1 = unknown" in summarise(explanation(fits=fits, missing=missing))
    for answer in (nothing(), cannot_tell(), unknown(), several()):
        assert summarise(replace(answer, fits=fits))
        assert trust(replace(answer, fits=fits))


def test_an_effect_that_has_no_description_is_named_as_it_is():
    new = replace(explanation().missing[0], effect="something_new")
    assert "something_new (98 %)" in summarise(explanation(missing=(new,), n=ROWS))
