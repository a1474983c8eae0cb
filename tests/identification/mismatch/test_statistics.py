"""What the mismatch tool's statistics rest on: white residuals, inputs without an edge for delays, honest hold-outs."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.drive import order_of
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mismatch.fit.fitting import Problem, fit
from bevameter.identification.mismatch.fit.held_out import hold_out
from bevameter.identification.mismatch.fit.samples import MOST_ROWS, Samples, gather
from bevameter.identification.mismatch.fit.soil_variation import lay_out, whiten
from bevameter.identification.mismatch.fit.steps import scaled_inverse
from bevameter.identification.mismatch.fit.textbook import fit_textbook
from bevameter.identification.mismatch.fit.trial import Trial, situation, textbook_trial, try_adding
from bevameter.identification.mismatch.locate.regions import Whitened, _told, locate
from bevameter.identification.mismatch.name.naming import name
from bevameter.identification.mismatch.name.search import search
from bevameter.identification.noise import sensor_noise
from concealed.conceal import conceal
from scipy.optimize import brentq

WHEEL = Wheel(radius_m=0.15, width_m=0.1)


def table(**columns) -> WheelTable:
    return WheelTable({name: np.asarray(values, dtype=float) for name, values in columns.items()}, None, None, "made")


def samples_of(seed: int, protocol: str, slugs=(), level="plain") -> Samples:
    made = conceal(seed, slugs, level, protocol=protocol)
    keys = ("radius_m", "width_m", "grouser_height_m", "grouser_count")
    wheel = Wheel(**{key: made.vehicle[key] for key in keys})
    columns = WheelTable(made.recorded.columns, None, made.recorded.run, "made")
    return gather(columns, wheel, Vehicle(name="made", wheels=(wheel,), noise=made.vehicle["noise"]))


@pytest.mark.parametrize("smooth", [0, 1, 2])
def test_whitened_residuals_have_the_likelihood_of_the_full_covariance(smooth):
    rng = np.random.default_rng(1)
    rows, channels = 9, 2
    residuals = rng.normal(size=(rows, channels))
    seen = rng.random((rows, channels)) > 0.2
    by_variation, by_latent = rng.normal(size=(2, rows, channels, 2))
    latent = np.diag([0.3, 0.2])
    variance, spread, length = np.array([0.5, 0.8]), np.array([0.4, 0.6]), 1.5
    gap = np.concatenate([[np.inf], rng.uniform(0.1, 1.0, rows - 1)])
    gap[5] = np.inf
    columns, scales = np.where(seen, residuals, 0.0)[..., None].copy(), np.empty((rows, channels))
    whiten(columns, seen, by_variation, by_latent, latent, variance, spread, length, smooth, gap, scales)
    track = np.cumsum(np.where(np.isfinite(gap), gap, 1e6))
    away = np.abs(track[:, None] - track) / length
    matern = [lambda x: np.exp(-x), lambda x: (1 + x) * np.exp(-x), lambda x: (1 + x + x**2 / 3) * np.exp(-x)][smooth]
    alike = matern(brentq(lambda x: matern(x) - np.exp(-1.0), 0.5, 5.0) * away)
    covariance = np.einsum("ica,a,jda,ij->icjd", by_variation, spread**2, by_variation, alike)
    for row in range(rows):
        covariance[row, :, row, :] += by_latent[row] @ latent @ by_latent[row].T + np.diag(variance)
    flat = seen.ravel()
    full = covariance.reshape(rows * channels, -1)[np.ix_(flat, flat)]
    values = residuals.ravel()[flat]
    expected = 0.5 * values @ np.linalg.solve(full, values) + 0.5 * np.linalg.slogdet(full)[1]
    assert 0.5 * (columns[seen] ** 2).sum() + np.log(scales).sum() == pytest.approx(expected, rel=1e-9)
    assert (columns[~seen] == 0.0).all()


def test_what_nothing_was_seen_or_carried_of_takes_no_part_and_slopes_without_bounds_neither():
    rng = np.random.default_rng(3)
    residuals, by_parameter = rng.normal(size=(4, 2)), rng.normal(size=(4, 5, 3))
    seen, carried = np.ones((4, 2), dtype=bool), np.array([True, True, False, True])
    seen[0, 1] = False
    residuals[0, 1], by_parameter[2], by_parameter[3, 4, 1] = np.nan, np.nan, 1e15
    order, columns = np.array([2, 0, 3, 1]), np.full((4, 2, 4), np.nan)
    lay_out(residuals, by_parameter, order, np.array([1, 4]), seen, carried, columns)
    expected = np.concatenate([residuals[..., None], by_parameter[:, [1, 4]]], axis=2)
    expected[0, 1], expected[2, :, 1:], expected[3, 1, 2] = 0.0, 0.0, 0.0
    np.testing.assert_array_equal(columns, expected[order])


@pytest.mark.parametrize("lag", [1, 2, 3])
def test_averaged_inputs_are_no_quieter_at_another_time(lag):
    """Noise left in a prediction from a delayed input must not fall below that of the input in time."""
    rng = np.random.default_rng(2)
    count, noise = 1400, 0.01
    truth = np.interp(np.arange(count), np.arange(0, count + 100, 100), rng.uniform(0.1, 0.5, count // 100 + 1))
    error = noise * np.clip(rng.standard_t(4, count) / np.sqrt(2.0), -4.0, 4.0)
    drive = gather(
        table(time_s=np.arange(count) / 10.0, load_N=np.full(count, 80.0), slip=truth + error, torque_Nm=truth),
        WHEEL,
        Vehicle(name="made", wheels=(WHEEL,), noise={"slip": noise, "load_N": 1.0, "torque_Nm": 1.0}),
    ).drive
    assert len(drive) == count
    smooth = drive.slip - truth
    late = error[:-lag] - smooth[:-lag] + smooth[lag:]
    assert np.std(late) > 0.97 * np.std(error)


def made_drive(load: np.ndarray, speed: np.ndarray) -> Samples:
    count = len(load)
    return gather(
        table(
            time_s=np.arange(count) / 10.0, load_N=load, slip=0.3 + 0.2 * np.sin(np.arange(count) / 30.0),
            torque_Nm=load / 20.0, travel_speed_m_s=speed, x_m=np.concatenate([np.arange(count // 2)] * 2) / 100.0,
        ),
        WHEEL,
        Vehicle(name="made", wheels=(WHEEL,), noise={"load_N": 0.5, "slip": 0.01, "torque_Nm": 0.05}),
    )  # fmt: skip


@pytest.mark.parametrize("row", [0, 199, 200, 399])
def test_a_gross_error_at_either_end_of_a_track_is_no_load(row):
    """Seed 70124: the first load of a pass, 36 sensor noises off, passed for a sinkage that comes late."""
    load = 80.0 + 0.5 * np.random.default_rng(3).normal(size=400)
    load[row] = 110.0
    samples = made_drive(load, np.full(400, 0.05))
    assert len(samples) == 399
    assert samples.measured[:, 0].max() < 90.0


def test_a_jump_of_load_is_taken_as_it_stands():
    load = np.where(np.arange(400) % 200 < 90, 45.0, 95.0) + 0.5 * np.random.default_rng(3).normal(size=400)
    drive = made_drive(load, np.full(400, 0.05)).drive
    beside = [89, 90, 289, 290]
    assert drive.load_N[beside] == pytest.approx(load[beside])
    assert np.std(drive.load_N[100:199] - 95.0) < 0.25


def test_a_speed_that_varies_by_its_noise_alone_is_no_variable():
    """Seed 70121: its error is that of slip as well, and drawbar pull seemed to rise with it."""
    rng = np.random.default_rng(4)
    load = 80.0 + 10.0 * np.sin(np.arange(400) / 20.0)
    held, varied = np.full(400, 0.05), 0.05 + 0.01 * np.sin(np.arange(400) / 25.0)
    noise = 5e-4 * rng.normal(size=400)
    assert not made_drive(load, held + noise).drive.has("travel_speed_m_s")
    assert made_drive(load, varied + noise).drive.has("travel_speed_m_s")


def test_a_wheel_set_down_elsewhere_begins_a_new_stretch():
    place = np.concatenate([np.linspace(0.0, 2.0, 50), np.linspace(0.0, 2.0, 50), np.linspace(5.0, 7.0, 50)])
    _, stretch = order_of(table(time_s=np.arange(150) / 10.0, x_m=place))
    assert np.flatnonzero(np.diff(stretch)).tolist() == [49, 99]


def test_a_soil_is_found_in_spite_of_a_variation_that_could_explain_anything():
    """Seed 406: from a wrong soil, all residuals pass for soil that varies by 30 %."""
    made = conceal(406, (), "hidden")
    _, fitted = fit_textbook(samples_of(406, made.truth["protocol"], level="hidden"))
    assert fitted.noise.spread.max() < 0.06
    assert np.exp(fitted.vector[3]) == pytest.approx(made.truth["soil"]["stiffness_Pa"], rel=0.3)


def test_blocks_held_out_are_predicted_as_by_a_fit_without_them():
    samples = samples_of(3, "steady")
    problem, fitted = fit_textbook(samples)
    held = hold_out(problem, fitted)
    block = samples.block == 0
    others = np.where(block[:, None], np.nan, samples.measured)
    others[:, [0, 3]] = samples.measured[:, [0, 3]]
    without = fit(
        Problem(replace(samples, measured=others)), AugmentedWheel(samples.wheel), fitted.vector, fitted.noise
    )
    answer = without.model.predict(samples.drive, problem.imposed, without.vector).channels[:, problem.answers]
    honest = (problem.measured - answer)[block]
    apart = (held.residuals[block] - honest) / fitted.noise.answers
    assert np.nanmax(np.abs(apart)) < 0.5


def test_long_recordings_are_thinned_in_stretches_and_say_so():
    count = 20_000
    rng = np.random.default_rng(0)
    slip = 0.3 + 0.2 * np.sin(np.arange(count) / 90.0)
    columns = table(
        time_s=np.arange(count) / 50.0, load_N=80.0 + rng.normal(size=count), slip=slip,
        torque_Nm=3.0 + 4.0 * slip + 0.05 * rng.normal(size=count),
    )  # fmt: skip
    samples = gather(columns, WHEEL, Vehicle(name="made", wheels=(WHEEL,), noise={}))
    assert len(samples) <= MOST_ROWS
    assert any("20000 rows thinned" in note for note in samples.notes)
    steps = np.diff(samples.drive.time_s)
    assert np.mean(np.isclose(steps, 0.02)) > 0.95


def test_many_trials_need_no_table_of_all_pairs(rng):
    """The noise was read from distances between all of them: ten thousand asked for gigabytes."""
    slip, load = rng.uniform(0.05, 0.6, 30_000), rng.uniform(50.0, 150.0, 30_000)
    columns = {"load_N": load, "slip": slip, "torque_Nm": 3.0 + 4.0 * slip + 0.05 * rng.normal(size=30_000)}
    noise = sensor_noise(WheelTable(columns, None, None, "made"), Vehicle(wheels=(WHEEL,)))
    assert noise[1] == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize("protocol", ["steady", "field"])
def test_hardly_any_place_stands_out_where_nothing_is_missing(protocol):
    """One false statement in a hundred made is allowed; here all that are made are false."""
    found = []
    for seed in range(7300, 7306):
        problem, textbook = fit_textbook(samples_of(seed, protocol))
        found += [(region.channel, region.variable, region.p_value) for region in locate(problem, textbook)]
    assert len({(channel, variable) for channel, variable, _ in found}) <= 1, found


def test_what_a_question_gains_is_never_negative():
    """Units of megapascals and micrometres must not cost digits."""
    problem, textbook = fit_textbook(samples_of(7310, "bench", ("slip_sinkage",)))
    whites = Whitened(problem, textbook, textbook.noise, scaled_inverse(textbook.covariance))
    assert len(whites.questions) > 5 * len(problem.answers)
    for number in range(len(whites.questions)):
        alone = whites.gain(number)
        assert alone >= 0.0
        # What is asked twice over has nothing to add.
        assert whites.gain(number, [number]) <= 1e-6 * max(alone, 1.0)


def explained(seed: int, slug: str):
    samples = samples_of(seed, "bench", (slug,))
    problem, textbook = textbook_trial(samples)
    effects = effects_for(situation(problem, textbook.fitted), [slug])
    return locate(problem, search(problem, textbook, effects).chosen.fitted)


def test_a_channel_that_is_off_by_the_same_everywhere_depends_on_nothing():
    first = explained(7320, "sinkage_offset")[0]
    offset_m = conceal(7320, ("sinkage_offset",), "plain", protocol="bench").truth["effects"][0]["parameters"][
        "offset_m"
    ]
    assert (first.channel, first.variable) == ("sinkage_m", "constant")
    assert first.start == pytest.approx(offset_m, rel=0.2)
    assert first.end == pytest.approx(offset_m, rel=0.2)


def test_variables_that_go_together_are_not_each_named():
    regions = explained(7321, "slip_sinkage")
    of_sinkage = [region for region in regions if region.channel == "sinkage_m"]
    assert of_sinkage[0].variable == "slip"
    assert sum(region.share for region in of_sinkage) <= 1.0 + 1e-9
    assert sum(region.share for region in of_sinkage if region.variable == "rim_speed_m_s") < 0.2


def test_a_soil_that_carries_nothing_predicts_nothing_and_pays_for_it():
    problem, textbook = fit_textbook(samples_of(7311, "steady"))
    residuals = textbook.residuals.copy()
    residuals[:3] = np.nan
    assert (problem.loss(residuals, textbook)[:3] > problem.loss(textbook.residuals, textbook)[:3] + 50.0).all()


def test_an_effect_is_not_more_probable_for_having_many_forms():
    """On a wheel that turns one way, Coulomb friction, of several forms, and a torque sensor's zero are one number."""
    problem, textbook = textbook_trial(samples_of(7325, "bench", ("torque_offset",)))
    effects = effects_for(situation(problem, textbook.fitted), ["torque_offset", "drivetrain_friction"])
    assert sum(effect.slug == "drivetrain_friction" for effect in effects) > 2
    naming = name(search(problem, textbook, effects), 0.0)
    together = naming.effects["torque_offset"] + naming.effects["drivetrain_friction"]
    assert together == pytest.approx(1.0 - naming.unknown, abs=0.02)
    assert naming.effects["torque_offset"] == pytest.approx(0.5, abs=0.25)


def test_a_patch_is_looked_for_where_other_effects_leave_one():
    """Beside a gain the residuals' levels are those of the gain; once it is found they are those of the patch."""
    made = samples_of(50103, "bench", ("soil_patch", "torque_gain"))
    problem, textbook = textbook_trial(made)
    effects = effects_for(situation(problem, textbook.fitted), ["soil_patch", "torque_gain"])
    assert search(problem, textbook, effects).chosen.slugs == {"soil_patch", "torque_gain"}


def test_a_start_that_first_leads_downhill_is_followed_to_its_end():
    problem, textbook = textbook_trial(samples_of(50201, "field", ("hard_layer",)))
    layer = effects_for(situation(problem, textbook.fitted), ["hard_layer"])[0]
    assert try_adding(problem, textbook, textbook, layer).gain > 100.0


def test_a_fit_far_behind_another_ends_early_and_one_that_leads_does_not(monkeypatch):
    problem, textbook = textbook_trial(samples_of(7110, "steady", ("slip_sinkage",)))
    effects = effects_for(situation(problem, textbook.fitted), ["slip_sinkage", "drivetrain_friction"])
    sinking = max((try_adding(problem, textbook, textbook, each) for each in effects), key=lambda trial: trial.gain)
    other = next(effect for effect in effects if effect.slug == "drivetrain_friction")
    asked = []
    linearise = Problem.linearise
    monkeypatch.setattr(Problem, "linearise", lambda *given: asked.append(1) or linearise(*given))

    def tried(effect, rival: float) -> tuple[float, int]:
        asked.clear()
        return try_adding(problem, textbook, textbook, effect, rival).fitted.score, len(asked)

    (exact, many), (near, fewer) = tried(other, -np.inf), tried(other, sinking.fitted.score)
    assert fewer < many
    assert near == pytest.approx(exact, abs=0.1 * (sinking.fitted.score - exact))
    assert tried(sinking.effects[0], sinking.fitted.score - 5.0)[0] == pytest.approx(sinking.fitted.score, abs=0.1)


def told(seed: int, slugs: tuple[str, ...]) -> tuple[Problem, Trial]:
    """A recording whose soil was measured elsewhere: c to 10 %, phi to half a degree."""
    truth = conceal(seed, slugs, "buried", protocol="bench").truth["soil"]
    known = SoilKnowledge(
        {name: truth[name] for name in ("c_Pa", "phi_rad")}, {"c_Pa": 0.1 * truth["c_Pa"], "phi_rad": 0.009}
    )
    return textbook_trial(samples_of(seed, "bench", slugs, level="buried"), known)


def test_a_soil_measured_elsewhere_is_held_out_like_a_block():
    """Seed 90147: a rim smoother than the soil is a weaker soil, but for what is known of the soil."""
    problem, textbook = told(90147, ("rim_adhesion",))
    effects = effects_for(situation(problem, textbook.fitted), ["rim_adhesion", "torque_offset", "hard_layer"])
    found = search(problem, textbook, effects)
    assert found.chosen.slugs == {"rim_adhesion"}
    assert found.chosen.gain > 30.0
    assert len(found.chosen.held_out.nats) == len(np.unique(problem.samples.block)) + 1


def test_a_soil_measured_elsewhere_that_agrees_asks_for_nothing():
    problem, textbook = told(7340, ())
    effects = effects_for(situation(problem, textbook.fitted), ["rim_adhesion", "torque_offset", "stress_peak_shift"])
    assert search(problem, textbook, effects).chosen.effects == ()


@pytest.mark.parametrize(("ahead", "told_first"), [(1.5, 1), (8.0, 0)])
def test_of_two_questions_about_one_variable_that_of_fewer_columns_is_told(ahead, told_first):
    """A patch of 22 nats was told between the cells of a scan of ten, and once more from edge to edge."""

    class Asked:
        questions = (SimpleNamespace(position=2, variable="x_m"),) * 2

        def freedom(self, number: int) -> int:
            return (10, 1)[number]

        def gain(self, number: int, given) -> float:
            return 0.5

        def spans(self, number: int, given):
            return ((0.0, 1.0, 1.0, 3.0),)

    told = _told(Asked(), {0: 20.0 + ahead, 1: 20.0}, set())
    assert [number for number, *_ in told] == [told_first]
