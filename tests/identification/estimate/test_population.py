"""The population of load and slip: density, moments and clusters."""

import numpy as np
import pytest
from bevameter.identification.estimate.population import Grid, Population
from bevameter.identification.estimate.spline import Spline


def curve(grid: Grid, slope: float, bent: float) -> np.ndarray:
    """Coefficients of a load [N] that rises with slip along a curve."""
    return np.append(slope, np.full(len(grid.spline) - 1, bent)) / len(grid.spline)


@pytest.fixture
def two_habits(rng) -> np.ndarray:
    """Slips of a driver who holds 0.1 or 0.5, measured with a noise of 0.05."""
    return np.where(rng.uniform(size=400) < 0.5, 0.1, 0.5) + 0.05 * rng.normal(size=400)


def test_it_is_a_density_with_the_moments_that_it_states(two_habits):
    grid = Grid.over(two_habits, 0.05)
    shares = np.linspace(1.0, 3.0, len(grid.places))
    population = Population(grid, shares / shares.sum(), 0.03, 800.0, curve(grid, 120.0, 60.0), 60.0)
    load, slip = np.meshgrid(np.linspace(0.0, 1800.0, 601), np.linspace(-1.0, 1.6, 601), indexing="ij")
    nodes = np.stack([load, slip], axis=-1)
    mass = np.exp(population.log_density(nodes)) * (1800.0 / 600) * (2.6 / 600)
    assert mass.sum() == pytest.approx(1.0, abs=1e-3)
    mean, covariance = population.moments
    points, weights = nodes.reshape(-1, 2), mass.ravel()
    assert mean == pytest.approx(weights @ points, rel=1e-3)
    away = points - mean
    assert covariance == pytest.approx((away * weights[:, None]).T @ away, rel=5e-3)


def test_without_samples_it_is_as_wide_as_the_measured_slips_less_their_noise(rng):
    grid = Grid.over(0.3 + 0.1 * rng.normal(size=5000), 0.06)
    population = Population.beginning(grid, np.full(10, 800.0), 20.0, 2.0)
    mean, covariance = population.moments
    assert mean == pytest.approx([800.0, 0.3], abs=0.01)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(0.08, rel=0.15)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(2.0)
    assert population.log_prior() == 0.0


@pytest.mark.parametrize("gross", [-0.98, 0.95, -5.0])
def test_gross_errors_do_not_widen_its_kernels(rng, gross):
    slip = 0.3 + 0.02 * rng.normal(size=300)
    clean, spoilt = Grid.over(slip, 0.01), Grid.over(np.where(np.arange(300) % 100 == 7, gross, slip), 0.01)
    assert spoilt.widths[0] == pytest.approx(clean.widths[0], rel=0.1)
    # A slip far off is unlikely, and possible.
    population = Population.beginning(spoilt, np.full(300, 800.0), 5.0, 1.0)
    usual, far = population.log_density(np.array([[800.0, 0.3], [800.0, gross]]))
    assert 3.0 < usual - far < 15.0


def test_on_another_grid_it_is_the_same_but_for_detail(two_habits):
    grid, other = Grid.over(two_habits, 0.05), Grid.over(two_habits[:-40], 0.05)
    shares = np.exp(-0.5 * ((grid.places - 0.4) / 0.1) ** 2) + 1e-4
    population = Population(grid, shares / shares.sum(), 0.0, 800.0, curve(grid, 120.0, 60.0), 60.0)
    carried = population.carried(other)
    (mean, covariance), (before, spread) = carried.moments, population.moments
    assert carried.grid is other
    assert mean == pytest.approx(before, rel=0.02)
    assert np.diag(covariance) == pytest.approx(np.diag(spread), rel=0.1)
    # The curve of load by slip stays where it was.
    line, carried_line = (each.load_by_slip(np.linspace(0.0, 0.6, 7))[0] for each in (population, carried))
    assert carried_line == pytest.approx(line, abs=0.02 * np.ptp(line))


def test_shifting_it_moves_its_means_only(two_habits):
    population = Population.beginning(Grid.over(two_habits, 0.05), np.full(400, 800.0), 20.0, 2.0)
    moved = population.moved(5.0, -0.01, 0.0, 0.0 * population.curve, 2.0)
    assert moved.moments[0] - population.moments[0] == pytest.approx([5.0, -0.01])
    assert moved.moments[1] == pytest.approx(population.moments[1])


def test_it_learns_that_slips_come_in_two(two_habits):
    grid = Grid.over(two_habits, 0.05)
    population = Population.beginning(grid, np.full(400, 800.0), 20.0, 2.0)
    # Each sample's posterior under the present population: kernels of the noise about what was measured.
    offsets = np.linspace(-3.0, 3.0, 13)
    nodes = np.stack(np.broadcast_arrays(800.0, two_habits[:, None] + 0.05 * offsets), axis=-1)
    for _ in range(20):
        density = np.exp(population.log_density(nodes) - 0.5 * offsets**2)
        responsibility = density / density.sum(axis=1, keepdims=True)
        population = population.improved(nodes[..., 1], responsibility, np.ones(400))
    at = np.exp(population.log_density(np.array([[800.0, 0.1], [800.0, 0.3], [800.0, 0.5]])))
    assert at[0] > 3.0 * at[1]
    assert at[2] > 3.0 * at[1]
    assert population.log_prior() < 0.0


def test_a_few_samples_leave_it_nearly_normal(two_habits):
    grid = Grid.over(two_habits, 0.05)
    normal = Population.beginning(grid, np.full(400, 800.0), 20.0, 2.0)
    nodes = np.array([[[800.0, 0.1]], [[800.0, 0.5]], [[800.0, 0.5]]])
    learnt = normal.improved(nodes[..., 1], np.ones((3, 1)), np.ones(3))
    assert np.abs(learnt.shares - normal.shares).max() < 0.15


def scored(population: Population, load: np.ndarray, slip: np.ndarray) -> Population:
    """Estimate level, curve and deviation of loads and slips (n,) that are known, by steps of scoring."""
    for _ in range(100):
        basis = population.basis(slip)[0]
        terms = np.column_stack([np.ones(len(load)), basis])
        away = load - population.load_by_slip(slip)[0]
        straight = np.zeros((terms.shape[1],) * 2)
        straight[1:, 1:] = population.grid.spline.straight
        level, *curve = np.linalg.solve(terms.T @ terms + straight, terms.T @ away - straight[:, 1:] @ population.curve)
        wider = 0.5 * float(np.mean((away / population.deviation) ** 2) - 1.0)
        population = population.moved(level, 0.0, wider, np.array(curve), 1e-3)
    return population


def test_load_goes_with_slip_where_slip_varies_and_not_where_it_does_not(rng):
    slip = rng.uniform(0.0, 0.6, 300)
    load = 500.0 + 900.0 * slip + 10.0 * rng.normal(size=300)
    fitted = scored(Population.beginning(Grid.over(slip, 0.01), load, 5.0, 1.0), load, slip)
    assert fitted.load_by_slip(np.array([0.1, 0.5]))[1] == pytest.approx(900.0, rel=0.1)
    assert fitted.deviation == pytest.approx(10.0, rel=0.2)
    held = 0.3 + 1e-6 * slip
    # A plain regression would give 9e8 N of load per unit of slip.
    level = scored(Population.beginning(Grid.over(held, 0.01), load, 5.0, 1.0), load, held)
    assert abs(level.load_by_slip(np.array([0.3]))[1][0]) < 100.0


def test_load_goes_with_slip_along_a_curve(rng):
    slip = rng.beta(0.6, 2.0, 500)
    truth = 300.0 + 400.0 / (1.0 + 8.0 * slip)
    load = truth + 5.0 * rng.normal(size=500)
    fitted = scored(Population.beginning(Grid.over(slip, 0.01), load, 1.0, 1.0), load, slip)
    assert np.sqrt(np.mean((fitted.load_by_slip(slip)[0] - truth) ** 2)) < 4.0
    assert fitted.deviation == pytest.approx(6.0, rel=0.2)
    # near a sample it is the normal distribution of its tangent
    at = np.array([[450.0, 0.2], [400.0, 0.4]])
    mean, slope = fitted.load_by_slip(at[:, 1])
    away, root = fitted.nearby(at)
    assert away[:, 0] * fitted.deviation == pytest.approx(at[:, 0] - mean)
    assert root[:, 0, 1] / root[:, 1, 1] == pytest.approx(slope)


def test_a_spline_has_the_derivative_of_differences_and_is_straight_beyond_its_knots(rng):
    spline = Spline.over(rng.beta(1.0, 2.0, 200), 0.01)
    slip, step = np.linspace(-0.2, 1.2, 40), 1e-6
    terms, slopes = spline.basis(slip)
    assert len(spline) == 6
    assert slopes == pytest.approx((spline.basis(slip + step)[0] - terms) / step, abs=1e-3)
    beyond = spline.basis(np.array([-0.1, -0.4, 1.1, 1.4]))[1]
    assert beyond[[0, 2]] == pytest.approx(beyond[[1, 3]])
