"""First sentence and summary: that they agree, and that what is not told apart can be read."""

from __future__ import annotations

from dataclasses import replace

import pytest
from bevameter import Wheel
from bevameter.identification.effects.named import forms_by_name, specimen
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mismatch.explanation import Candidate, Missing
from bevameter.identification.mismatch.show.headline import verdict
from bevameter.identification.mismatch.show.report import report_html
from bevameter.identification.mismatch.show.wording import summarise, trust
from explanations import explanation, nothing

ALL_WELL = "Nothing that held-out data ask for is missing from the simulation."


def missed(n: int):
    """Nothing found on so many rows, whose torque and sinkage stay above the noise."""
    fits = dict(nothing().fits)
    for name in ("torque_Nm", "sinkage_m"):
        fits[name] = replace(fits[name], rmse_before=3.0 * fits[name].noise, rmse_after=3.0 * fits[name].noise)
    return replace(nothing(), fits=fits, n=n)


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (nothing(), ALL_WELL),
        (replace(nothing(), n=6), f"{ALL_WELL[:-1]}, as far as 6 rows can tell."),
        (missed(400), "The simulation misses torque and sinkage by more than noise, and what was recorded does not "
                      "tell why."),
        (missed(6), "6 rows are too few to tell what is missing: the simulation misses torque and sinkage by more than "
                    "noise."),
    ],
)  # fmt: skip
def test_the_first_sentence_says_that_all_is_well_only_where_it_is(answer, said):
    assert verdict(answer) == said
    above = "by more than noise" in said
    assert ("misses torque and sinkage by more than noise" in summarise(answer)) == above
    assert ("torque and sinkage stays above the noise" in trust(answer)) == above
    page = report_html(answer).replace("&nbsp;", " ")
    assert ("held-out rows ask for nothing" in page) != above
    assert ("nothing gains enough on rows held out" in page) == above


def test_another_simulator_on_another_soil_does_not_agree():
    fits = {
        name: replace(fit, rmse_before=4.0 * fit.noise, rmse_after=fit.noise) for name, fit in nothing().fits.items()
    }
    answer = replace(nothing(), fits=fits)
    assert verdict(answer) == (
        "No physics is known to be missing, but the other simulator's soil is another: its torque, sinkage and drawbar "
        "pull differ."
    )
    assert "its soil is another" in summarise(answer)


def several():
    """Slip-sinkage, and beside it one of four that look alike, two of them too improbable to be listed."""
    alike = ("sinkage_offset", "torque_gain", "drivetrain_friction", "load_gain")
    missing = (
        Missing("slip_sinkage", "physics", "exponent", 0.36, {}, "", "", ()),
        *(
            Missing(slug, "instrument", "", share, {}, "", "", tuple(each for each in alike if each != slug))
            for slug, share in (("sinkage_offset", 0.22), ("torque_gain", 0.07))
        ),
    )
    shares = {
        "slip_sinkage[exponent] + sinkage_offset": 0.20, "slip_sinkage[ratio] + torque_gain": 0.07,
        "slip_sinkage[exponent]": 0.05, "drivetrain_friction[viscous] + slip_sinkage[ratio]": 0.04,
        "sinkage_offset": 0.02, "load_gain": 0.002,
    }  # fmt: skip
    tried = tuple(Candidate(name, "physics", share, 50.0, {}, "") for name, share in shares.items())
    return explanation(verdict="cannot_tell", missing=missing, candidates=tried, simulator=wheel_with(
        ("slip_sinkage", "exponent"), ("sinkage_offset", "")
    ))  # fmt: skip


def wheel_with(*wanted: tuple[str, str]) -> AugmentedWheel:
    effects = [next(each for each in forms_by_name(slug, specimen()) if each.form == form) for slug, form in wanted]
    return AugmentedWheel(Wheel(radius_m=0.15, width_m=0.12), tuple(effects))


def test_what_is_not_told_apart_stands_together_with_what_is_left():
    said = summarise(several())
    assert (
        "These data do not tell for sure what it is. Probability of each, alone or with others: slip-sinkage 36 %; "
        "sinkage offset 22 %, torque gain 7 %, friction of the drive train 4 % and load gain < 0.5 %, which look alike "
        "here; none of these 62 %." in said
    )
    assert verdict(several()).endswith(
        "torque gain (very unlikely, 7 %); none of these (about as likely as not, 62 %)."
    )


def test_the_set_whose_errors_are_shown_is_named():
    said = summarise(several())
    named = "What fits best is slip-sinkage (exponent) and sinkage offset (that just these are missing: 20 %)."
    assert f"{named} With these the held-out error falls: torque from 1.2 to 0.52 N m" in said
    worse = replace(several().fits["drawbar_pull_N"], rmse_before=1.0, rmse_after=2.0)
    said = summarise(replace(several(), fits={**several().fits, "drawbar_pull_N": worse}))
    assert "It speaks against them that the held-out error rises: drawbar pull from 1 to 2 N." in said


def test_what_is_asserted_needs_no_other_name():
    sure = explanation(simulator=wheel_with(("slip_sinkage", "exponent")))
    assert "0.019. With it the held-out error falls" in summarise(sure)
    second = replace(sure.missing[0], effect="sinkage_offset", kind="instrument", probability=0.9)
    both = replace(sure, missing=(*sure.missing, second), simulator=several().simulator)
    assert ". With them the held-out error falls" in summarise(both)
    assert "What fits best is slip-sinkage (exponent) and sinkage offset" in summarise(
        replace(sure, simulator=several().simulator)
    ), "one of the two is not asserted"


def test_a_correction_is_told_from_what_is_beside_it():
    shape = Missing("unknown", "unknown", "", 0.97, {}, "f", "fitted", (), "", "torque T rises with slip i")
    alone = explanation(verdict="unknown", missing=(shape,))
    assert "rises with slip i. With that correction the held-out error falls" in summarise(alone)
    doubted = replace(alone, verdict="cannot_tell", missing=(replace(shape, probability=0.6),), candidates=())
    assert "Probability, alone or with others: a cause that the catalogue lacks 60 %;" in summarise(doubted)
    assert "With a smooth correction the held-out error falls" in summarise(doubted)
    beside = replace(alone, simulator=several().simulator)
    assert "With that correction, beside slip-sinkage (exponent) and sinkage offset, the held-out" in summarise(beside)


def test_one_that_is_doubted_is_weighed_against_something_else():
    one = Missing("slip_sinkage", "physics", "exponent", 0.48, {}, "", "", ())
    tried = (Candidate("slip_sinkage[exponent]", "physics", 0.48, 20.0, {}, ""),)
    answer = explanation(
        verdict="cannot_tell", missing=(one,), candidates=tried, simulator=wheel_with(("slip_sinkage", "exponent"))
    )
    said = summarise(answer)
    assert "Probability, alone or with others: slip-sinkage 48 %; something else or nothing 52 %." in said
    assert "What fits best is slip-sinkage (exponent) (that just this is missing: 48 %). With it the" in said
