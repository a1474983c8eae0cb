import dataclasses

import numpy as np
import pytest
from bevameter.database.posterior import class_soils, random_effects
from scipy.special import ndtr, stdtrit

GRADIENT = np.array([1.0, 20e3])
MEAN = np.array([1000.0, 0.6])
PRIOR = np.array([350.0, 0.06])


@pytest.mark.parametrize("places", [3, 8, 30])
@pytest.mark.parametrize("relative_noise", [0.05, 0.5])
def test_lower_bounds_cover_new_places(places, relative_noise):
    """95 % bounds for the true soil of a place not yet driven, at scatter like the literature's and above it."""
    rng = np.random.default_rng([places, int(100 * relative_noise)])
    covered = []
    for _ in range(300):
        scatter_sd = PRIOR * rng.uniform(1.0, 1.5)
        scatter = np.outer(scatter_sd, scatter_sd) * [[1.0, -0.3], [-0.3, 1.0]]
        sd = PRIOR * relative_noise * rng.uniform(0.5, 1.5, (places, 1))
        noise = sd[:, :, None] * sd[:, None, :] * np.array([[1.0, -0.8], [-0.8, 1.0]])
        estimates = rng.multivariate_normal(MEAN, scatter, size=places)
        estimates += np.array([rng.multivariate_normal([0.0, 0.0], one) for one in noise])
        location, scale, freedom = random_effects(estimates, noise, np.ones(places), PRIOR).predict(GRADIENT)
        bound = location + scale * stdtrit(freedom, 0.05)
        # The exact share of all places of the class that are stronger than the bound.
        covered.append(ndtr((GRADIENT @ MEAN - bound) / np.sqrt(GRADIENT @ scatter @ GRADIENT)))
    # With few stretches the prior's wide tails err on the side of caution.
    assert 0.93 <= np.mean(covered) <= (0.985 if places == 3 else 0.97), np.mean(covered)


@pytest.mark.parametrize("places", [3, 8])
def test_lower_bounds_hold_where_soil_scatters_twice_as_much_as_expected(places):
    rng = np.random.default_rng(places)
    scatter = np.diag((2.0 * PRIOR) ** 2)
    covered = []
    for _ in range(200):
        estimates = rng.multivariate_normal(MEAN, scatter, size=places)
        noise = np.zeros((places, 2, 2))
        location, scale, freedom = random_effects(estimates, noise, np.ones(places), PRIOR).predict(GRADIENT)
        bound = location + scale * stdtrit(freedom, 0.05)
        covered.append(ndtr((GRADIENT @ MEAN - bound) / np.sqrt(GRADIENT @ scatter @ GRADIENT)))
    assert np.mean(covered) > 0.91


def test_without_noise_it_is_the_textbook_prediction_interval(rng):
    # Many places, no noise, negligible prior: mean and sample covariance, and about n - 1 degrees of freedom.
    y = rng.multivariate_normal([1000.0, 0.6], np.diag([200.0**2, 0.05**2]), size=400)
    fit = random_effects(y, np.zeros((400, 2, 2)), np.ones(400), PRIOR)
    np.testing.assert_allclose(fit.mean, y.mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(fit.scatter, np.cov(y.T), rtol=0.02, atol=0.3)
    np.testing.assert_allclose(fit.mean_covariance, fit.scatter / 400, rtol=1e-6)
    assert fit.predict(GRADIENT)[2] == pytest.approx(400, abs=2)


def test_precise_stretches_count_more():
    y = np.array([[1000.0, 0.5], [2000.0, 0.5]])
    noise = np.array([np.diag([10.0**2, 0.01**2]), np.diag([5000.0**2, 0.01**2])])
    assert random_effects(y, noise, np.ones(2), PRIOR).mean[0] < 1100.0


def test_improbable_stretches_count_less(make):
    soils = [make.soil({"sand": 1.0}, 1000.0), make.soil({"sand": 0.55, "clay": 0.45}, 2000.0)]
    alike = [soils[0], make.soil({"sand": 1.0}, 2000.0)]
    assert class_soils(soils)["sand"].strength.mean[0] < class_soils(alike)["sand"].strength.mean[0] - 50
    assert class_soils(soils)["sand"].weight == pytest.approx(1.55)


def test_more_places_make_the_bound_tighter(make):
    bounds = []
    for number in (1, 2, 5, 20):
        spread = np.linspace(-1.0, 1.0, number) if number > 1 else [0.0]
        soils = [make.soil({"sand": 1.0}, 1000.0 + 150.0 * one, 0.6 + 0.03 * one) for one in spread]
        location, scale, freedom = class_soils(soils)["sand"].strength.predict(GRADIENT)
        bounds.append(location + scale * stdtrit(freedom, 0.05))
    assert np.all(np.diff(bounds) > 0)
    assert bounds[0] > 0  # even one stretch is informative


def test_classes_without_soil_are_absent(make):
    soils = [
        make.soil({"sand": 0.9, "clay": 0.1}),
        make.soil({"clay": 0.4, "loam": 0.3, "sand": 0.3}),  # no class is probable
        make.soil({}),
        make.soil({"gravel": 1.0}, gate_reason="too fast"),
        dataclasses.replace(make.soil({"grass": 1.0}), estimate=None, gate_reason="no slip"),
        dataclasses.replace(
            make.soil({"loam": 1.0}),
            estimate=dataclasses.replace(make.estimate(), covariance_c_tan_phi=np.full((2, 2), np.inf)),
        ),
    ]
    assert list(class_soils(soils)) == ["sand"]
    assert class_soils(soils)["sand"].stretches == 1
    assert class_soils([]) == {}


def test_parameters_without_an_estimate_are_absent(make):
    estimate = make.estimate()
    bare = dataclasses.replace(
        estimate, parameters={name: value for name, value in estimate.parameters.items() if name != "k_m"}
    )
    soil = class_soils([dataclasses.replace(make.soil({"sand": 1.0}), estimate=bare)])["sand"]
    assert set(soil.others) == {"log_stiffness", "n"}


def test_a_singular_covariance_is_fine(make):
    # Cohesion and friction traded off exactly against each other, as one normal stress leaves them.
    tied = np.outer([1000.0, -0.05], [1000.0, -0.05])
    soils = [
        dataclasses.replace(
            make.soil({"sand": 1.0}, c, t),
            estimate=dataclasses.replace(make.estimate(c, t), covariance_c_tan_phi=tied),
        )
        for c, t in ((1000.0, 0.6), (3000.0, 0.5), (200.0, 0.64))
    ]
    fit = class_soils(soils)["sand"].strength
    assert np.all(np.isfinite(fit.predictive_covariance))
    assert np.all(np.linalg.eigvalsh(fit.scatter) > 0)
    location, scale, _ = fit.predict(GRADIENT)  # 20 kPa is where the trade-off is exact: all three agree there
    assert location == pytest.approx(13000.0, rel=0.01)
    assert scale < 3500.0


def lower_bound(soils) -> float:
    location, scale, freedom = class_soils(soils)["sand"].strength.predict(GRADIENT)
    return location + scale * stdtrit(freedom, 0.05)


def test_pieces_of_one_stretch_are_one_place_however_finely_it_is_cut(make):
    pieces = [make.soil({"sand": 1.0}, 1000.0 + 100.0 * (-1) ** each, at_s=5.0 * each) for each in range(16)]
    whole = make.soil({"sand": 1.0})
    assert class_soils(pieces)["sand"].weight == 1.0
    assert class_soils(pieces)["sand"].stretches == 16
    assert lower_bound(pieces) <= lower_bound([whole])
    apart = [dataclasses.replace(each, start_s=2.0 * each.start_s, end_s=2.0 * each.start_s + 5.0) for each in pieces]
    assert class_soils(apart)["sand"].weight == 16.0


def misfitting(soil):
    return dataclasses.replace(soil, estimate=dataclasses.replace(soil.estimate, misfit=4.0))


def test_estimates_of_a_wrong_form_never_tighten_the_bound(make):
    fitting = [make.soil({"sand": 1.0}, 1000.0 + 150.0 * one, at_s=20.0 * one) for one in range(3)]
    wrong = [misfitting(make.soil({"sand": 1.0}, 1100.0, at_s=100.0 + 20.0 * one)) for one in range(9)]
    assert lower_bound(fitting + wrong) == lower_bound(fitting)
    assert lower_bound(wrong) <= lower_bound(wrong[:1])
    between = [make.soil({"sand": 1.0}, at_s=5.0 * one) for one in range(3)]
    between[1] = misfitting(between[1])
    assert class_soils(between)["sand"].weight == 1.0
    assert class_soils(wrong)["sand"].misfits
    assert not class_soils(fitting + wrong)["sand"].misfits
