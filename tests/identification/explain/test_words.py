"""The answer in words holds what is in its fields: effects, probabilities, values with their units, what to measure."""

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


def holds(text: str, *parts: str) -> bool:
    return all(part in text for part in parts)


def test_an_effect_is_given_with_its_probability_its_values_and_its_gain():
    said = summarise(explanation())
    assert holds(said, "slip-sinkage (98 %)", "0.213 ± 0.019", "2.8 to 0.51 mm", "0.3 to 0.55", "1.2 to 0.52 N m")


def test_physics_come_before_faults_and_both_before_what_is_doubtful():
    said = headline(several())
    places = [said.index(part) for part in ("slip-sinkage (98 %)", "time lag", "(97 %)", "load gain (30 %)")]
    assert places == sorted(places)
    assert several().missing[2].would_tell in details(several())


def test_a_fault_alone_reads_otherwise_than_physics():
    fault = replace(several().missing[1], effect="sinkage_offset", form="")
    said = headline(explanation(verdict="instrument", missing=(fault,)))
    assert "sinkage offset (97 %)" in said
    assert said.split()[0] != headline(explanation()).split()[0]


def test_an_undecided_answer_lists_its_causes_and_the_measurement_that_separates_them():
    answer = cannot_tell()
    assert holds(headline(answer), "side-wall friction (55 %)", "torque gain (42 %)")
    assert answer.missing[0].would_tell in headline(answer)
    one = headline(replace(answer, missing=answer.missing[:1]))
    assert "side-wall friction (55 %)" in one
    assert "torque gain" not in one


def test_an_unknown_cause_is_located_and_given_with_the_effects_asserted():
    said = summarise(unknown())
    assert holds(said, "(93 %)", "rim speed")
    assert "_" not in said
    both = replace(unknown(), missing=(*unknown().missing, *explanation().missing))
    assert holds(headline(both), "slip-sinkage (98 %)", "(93 %)")


def test_an_answer_without_findings_states_the_number_of_rows():
    said = summarise(replace(nothing(), n=1200))
    assert said == headline(replace(nothing(), n=1200))
    assert "1,200" in said
    assert headline(replace(nothing(), n=6)) != said.replace("1,200", "6")


def test_channels_whose_errors_stay_above_the_noise_are_named():
    said = headline(missed(nothing()))
    assert holds(said, "torque", "sinkage", "3")
    assert "drawbar pull" not in said
    assert list(above_noise(missed(nothing()))) == ["torque_Nm", "sinkage_m"]


def test_another_simulator_on_another_soil_does_not_agree():
    fits = {name: replace(fit, rmse_before=4.0 * fit.rmse_after) for name, fit in nothing().fits.items()}
    said = headline(replace(nothing(), fits=fits))
    assert said != headline(nothing())
    assert holds(said, "torque", "sinkage", "drawbar pull")


def test_parameters_are_relied_on_only_where_all_is_certain_and_within_noise():
    certain = trust(explanation())
    for doubted in (several(), cannot_tell(), unknown(), missed(explanation()), missed(nothing())):
        assert trust(doubted) != certain


def test_a_channel_that_is_predicted_worse_is_reported():
    fits = {**explanation().fits, "torque_Nm": replace(explanation().fits["torque_Nm"], rmse_before=0.4)}
    worse = explanation(fits=fits)
    assert predicted_worse(worse) == ["torque"]
    assert "0.4 to 0.52 N m" in details(worse)
    assert trust(worse) != trust(explanation())
    assert predicted_worse(explanation()) == []
    assert predicted_worse(replace(nothing(), fits=fits)) == [], "nothing was added that could be worse"


def test_the_most_probable_set_is_named_where_nothing_is_asserted():
    assert "slip-sinkage (exponent)" in details(cannot_tell())


@pytest.mark.parametrize(
    ("region", "said"),
    [
        (Region("sinkage_m", "constant", 2e-3, 3e-3, 1.0, 1e-9, 5.0), "2 to 3 mm"),
        (Region("torque_Nm", "lag_s", 0.2, 0.3, 1.0, 1e-9, 5.0), "0.2 to 0.3 s"),
        (Region("torque_Nm", "wheel_angle_rad", 0.0, math.pi / 6.0, 1.0, 1e-9, 5.0), "12 cycles a turn"),
        (Region("torque_Nm", "pitch_rad", 0.0, math.radians(10.0), 1.0, 1e-9, math.nan), "0 to 10 deg"),
    ],
)
def test_the_place_of_the_difference_is_reported_in_the_units_of_its_variable(region, said):
    assert said in details(explanation(located=(region,)))
    assert "nan" not in details(explanation(located=(region,)))


@pytest.mark.parametrize(("count", "said"), [(3, "d2 = 0.50 ± 0.10"), (4, "1 more"), (6, "3 more")])
def test_parameters_beyond_the_first_few_are_counted(count, said):
    values = {f"d{number}": Estimate(0.5, 0.1) for number in range(count)}
    drift = Missing("drift", "instrument", "torque_Nm", 0.9, values, "", "")
    assert said in details(explanation(missing=(drift,)))


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
