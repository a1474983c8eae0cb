"""Speed of `explain`, and of fitting one effect, against `scipy.optimize.least_squares`.

python -m pytest tests/benchmarks/test_explain_speed.py --benchmark-only
"""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import explain
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.estimate.identify import open_recording
from bevameter.identification.explain.fit import fit, fit_textbook, with_effect
from bevameter.identification.explain.samples import gather
from bevameter.identification.explain.search import situation
from bevameter.identification.mechanics.augmented import Entry
from bevameter.identification.rows.select import select_wheel_rows
from concealed.conceal import conceal
from scipy.optimize import least_squares

SEED = 7200


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Make 1,200 samples of a bench test whose sinkage grows with slip."""
    place = tmp_path_factory.mktemp("recording")
    return conceal(SEED, ("slip_sinkage",), "hidden", protocol="bench").write(place / "slipping")


@pytest.mark.benchmark(group="explain, 1200 samples, whole catalogue")
def test_explain(benchmark, folder):
    """Explaining a recording of 1,200 rows."""
    answer = benchmark.pedantic(explain, args=(folder,), rounds=3, warmup_rounds=1)
    assert answer.n == pytest.approx(1200, abs=60)
    assert "slip_sinkage" in {missing.effect for missing in answer.missing}


@pytest.fixture(scope="module")
def started(folder):
    """Soil and one effect ready to be fitted."""
    rows = select_wheel_rows(open_recording(folder, None))
    problem, textbook = fit_textbook(gather(rows.table, rows.wheel, rows.vehicle))
    effect = next(iter(effects_for(situation(problem, textbook), ["slip_sinkage"])))
    return problem, textbook, *with_effect(textbook, effect, effect.starts()[0])


@pytest.mark.benchmark(group="soil and one effect fitted, 1200 samples")
def test_fit(benchmark, started):
    """One fit of a set of effects."""
    problem, textbook, model, start = started
    fitted = benchmark(fit, problem, model, start, textbook.noise, Entry(textbook.theta_1))
    assert fitted.score > textbook.score


@pytest.mark.benchmark(group="soil and one effect fitted, 1200 samples")
def test_least_squares_with_differences(benchmark, started):
    """The same simulator by `scipy.optimize.least_squares` with differences, a lesser problem."""
    problem, textbook, model, start = started
    channels = list(problem.answers)

    def misfit(vector: np.ndarray) -> np.ndarray:
        answer = model.predict(problem.samples.drive, problem.imposed, vector, textbook.theta_1).channels
        return np.nan_to_num((problem.measured - answer[:, channels]) / textbook.noise.sd).ravel()

    found = benchmark.pedantic(
        least_squares, args=(misfit, start), kwargs={"loss": "huber", "x_scale": "jac"}, rounds=3
    )
    assert found.cost < 0.5 * np.sum(misfit(start) ** 2)
