"""The population of load and slip: density, moments and clusters."""

import numpy as np
import pytest
from bevameter.identification.estimate.population import Grid, Population


@pytest.fixture
def two_habits(rng) -> np.ndarray:
    """Slips of a driver who holds 0.1 or 0.5, measured with a noise of 0.05."""
    return np.where(rng.uniform(size=400) < 0.5, 0.1, 0.5) + 0.05 * rng.normal(size=400)


def test_it_is_a_density_with_the_moments_that_it_states(two_habits):
    grid = Grid.over(two_habits, 0.05)
    shares = np.linspace(1.0, 3.0, len(grid.places))
    population = Population(grid, shares / shares.sum(), 0.03, 800.0, 400.0, 60.0)
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
    population = Population(grid, shares / shares.sum(), 0.0, 800.0, 400.0, 60.0)
    carried = population.carried(other)
    (mean, covariance), (before, spread) = carried.moments, population.moments
    assert carried.grid is other
    assert mean == pytest.approx(before, rel=0.02)
    assert np.diag(covariance) == pytest.approx(np.diag(spread), rel=0.1)
    # The line of load by slip stays where it was.
    line = [each.level + each.slope * (0.2 - each.moments[0][1]) for each in (population, carried)]
    assert line[1] == pytest.approx(line[0])


def test_shifting_it_moves_its_means_only(two_habits):
    population = Population.beginning(Grid.over(two_habits, 0.05), np.full(400, 800.0), 20.0, 2.0)
    moved = population.moved(5.0, -0.01)
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
        population = population.improved(nodes, responsibility, np.ones(400), 2.0, 1.0)
    at = np.exp(population.log_density(np.array([[800.0, 0.1], [800.0, 0.3], [800.0, 0.5]])))
    assert at[0] > 3.0 * at[1]
    assert at[2] > 3.0 * at[1]
    assert population.log_prior() < 0.0


def test_a_few_samples_leave_it_nearly_normal(two_habits):
    grid = Grid.over(two_habits, 0.05)
    normal = Population.beginning(grid, np.full(400, 800.0), 20.0, 2.0)
    nodes = np.array([[[800.0, 0.1]], [[800.0, 0.5]], [[800.0, 0.5]]])
    learnt = normal.improved(nodes, np.ones((3, 1)), np.ones(3), 2.0, 1.0)
    assert np.abs(learnt.shares - normal.shares).max() < 0.15


def test_load_goes_with_slip_where_slip_varies_and_not_where_it_does_not(rng):
    slip = rng.uniform(0.0, 0.6, 300)
    load = 500.0 + 900.0 * slip + 10.0 * rng.normal(size=300)
    grid = Grid.over(slip, 0.01)
    beginning = Population.beginning(grid, load, 5.0, 1.0)
    nodes = np.stack([load, slip], axis=-1)[:, None]
    fitted = beginning.improved(nodes, np.ones((300, 1)), np.ones(300), 1.0, 1.0)
    assert fitted.slope == pytest.approx(900.0, rel=0.05)
    assert fitted.deviation == pytest.approx(10.0, rel=0.5)
    held = np.stack([load, 0.3 + 1e-6 * slip], axis=-1)[:, None]
    # A plain regression would give 9e8 N of load per unit of slip.
    assert abs(beginning.improved(held, np.ones((300, 1)), np.ones(300), 1.0, 1.0).slope) < 100.0
