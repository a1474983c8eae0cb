"""The answer, assembled from hypotheses, their posterior, held-out rows and located regions."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from ...framework.core.explanation import ASSERTED, verdict_of
from ...framework.core.soil import PARAMETERS
from ..effects.effect import Effect
from ..mechanics.augmented import SOIL_COUNT
from ..mechanics.soil import from_internal, slope_of_internal
from ..mechanics.textbook import CHANNELS
from .discriminate import propose_drive, propose_measurement
from .evidence import Discrepancy, dependence
from .explanation import (
    Candidate,
    ChannelFit,
    Estimate,
    ExplainedGround,
    Explanation,
    Missing,
    Region,
    Rows,
    Screened,
)
from .fit import Fitted
from .held_out import HeldOut, hold_out
from .likelihood import Problem
from .posterior import UNKNOWN, Posterior
from .search import Hypothesis, Search
from .variables import names_of

MENTIONED = 0.05
"""Least probability of an effect that is listed where none is asserted, and of a candidate that is held out [-]."""

MOST_LISTED = 6
"""Most effects that are listed; all that were fitted are among the candidates."""

_GROSS = 8.0
"""Innovation beyond which a value is a gross error [-]."""

_RESAMPLES = 400

_SOIL_UNITS = {"c_Pa": "Pa", "phi_rad": "rad", "k_m": "m", "stiffness_Pa": "Pa", "n": ""}


@dataclass(frozen=True)
class Chosen:
    """The most probable hypothesis, its discrepancy if any, and held-out rows of the textbook wheel and of it."""

    hypothesis: Hypothesis
    discrepancy: Discrepancy | None
    before: HeldOut
    after: HeldOut


def choose(problem: Problem, found: Search, posterior: Posterior) -> Chosen:
    """Choose the most probable set, in its most probable form."""
    first = next(iter(posterior.sets))
    hypothesis = posterior.best[first - {UNKNOWN}]
    before = hold_out(problem, found.textbook.fitted)
    after = hold_out(problem, hypothesis.fitted, discrepant=UNKNOWN in first) if first else before
    added = posterior.discrepancies[first - {UNKNOWN}] if UNKNOWN in first else None
    return Chosen(hypothesis, added, before, after)


def assemble(
    problem: Problem, found: Search, posterior: Posterior, chosen: Chosen, regions: tuple[Region, ...], *,
    source: str, seed: int, began: float, notes: tuple[str, ...] = (), simulated: np.ndarray | None = None,
) -> Explanation:  # fmt: skip
    """Assemble the answer.

    Parameters
    ----------
    problem, found, posterior, chosen, regions
        Results of the previous steps.
    source, seed, began, notes
        The recording, the seed of resampling, the time of the start [s], and notes on the rows.
    simulated : (n, 5)
        Residuals of another simulator, which replace those of the textbook wheel.
    """
    missing = missing_of(problem, found, posterior, chosen)
    verdict = verdict_of(missing)
    before, after = chosen.before.residuals, chosen.after.residuals
    if verdict == "none":
        after, regions = before, ()
    if simulated is not None:
        before = simulated[:, problem.answers]
    best = found.textbook if verdict == "none" else chosen.hypothesis
    gross = problem.seen & (np.abs(best.fitted.white.innovations) > _GROSS)
    before, after = (np.where(gross, np.nan, each) for each in (before, after))
    gained = chosen.after.gain(chosen.before) if verdict != "none" else (0.0, 0.0)
    return Explanation(
        source=source,
        verdict=verdict,
        summary="",
        grounds=_grounds(problem, best, found, posterior),
        trust="",
        located=regions,
        missing=missing,
        candidates=_candidates(problem, found, posterior, chosen.before),
        screened=tuple(Screened(*pair) for pair in sorted(found.screened.items(), key=lambda pair: -pair[1])),
        fits=_fits(problem, before, after, best.fitted, np.random.default_rng(seed)),
        split=problem.samples.split,
        heldout_nats=Estimate(*gained),
        notes=(*notes, *problem.samples.notes, *_notes(problem, best.fitted, chosen, int(gross.sum()))),
        rows=_rows(problem, before, after, best.fitted),
        simulator=best.fitted.model,
        vector=best.fitted.vector,
        covariance=best.fitted.covariance(problem),
        believed={slug: float(posterior.effects.get(slug, 0.0)) for slug in sorted(best.slugs)},
        seconds=time.perf_counter() - began,
        seed=seed,
        n=int(problem.seen.any(axis=1).sum()),
    )


def missing_of(problem: Problem, found: Search, posterior: Posterior, chosen: Chosen) -> tuple[Missing, ...]:
    """List the asserted effects and, if these leave a probability of half or more, their rivals.

    Empty only if the textbook wheel has a probability above a half.
    """
    if posterior.sets.get(frozenset(), 0.0) > 0.5:
        return ()
    asserted = [slug for slug, share in posterior.effects.items() if share >= ASSERTED]
    listed = list(asserted)
    left = 1.0 - sum(share for slugs, share in posterior.sets.items() if slugs - {UNKNOWN} <= set(asserted))
    # Where the probability is spread over many, the first of them are listed all the same.
    least = MENTIONED if max([posterior.unknown, *posterior.effects.values()]) >= MENTIONED else 0.0
    if not asserted or left >= 0.5:
        rivals = sorted(posterior.effects, key=lambda slug: -posterior.effects[slug])
        listed += [slug for slug in rivals if slug not in listed and posterior.effects[slug] >= least]
    answer = [_missing(problem, found, posterior, chosen, slug) for slug in listed[:MOST_LISTED]]
    if posterior.unknown >= (0.5 if asserted else least):
        answer.append(_unknown(problem, posterior, chosen))
    return tuple(sorted(answer, key=lambda each: -each.probability))


def _missing(problem: Problem, found: Search, posterior: Posterior, chosen: Chosen, slug: str) -> Missing:
    """Describe an effect by the most probable hypothesis that includes it."""
    probability = posterior.effects[slug]
    holding = [each for each in found.hypotheses if slug in each.slugs]
    best = max(holding, key=found.log_posterior)
    if slug in chosen.hypothesis.slugs:
        best = chosen.hypothesis
    effect = next(each for each in best.effects if each.slug == slug)
    rivals = rivals_of(posterior, slug)
    others = [posterior.best[slugs] for slugs in rivals.values()]
    # A fault has its own check; the measurement that separates physical effects is computed.
    computed = effect.kind != "instrument" and probability < ASSERTED and others
    measurement = propose_measurement(problem, best, *others) if computed else effect.check
    return Missing(
        effect.slug, effect.kind, effect.form, probability, _parameters(problem, found, best, effect), effect.equation,
        effect.source, tuple(rivals), measurement or effect.check, where=effect.where, belongs_to=effect.belongs_to,
    )  # fmt: skip


def rivals_of(posterior: Posterior, slug: str) -> dict[str, frozenset[str]]:
    """Effects that replace this one in other probable sets, with the most probable such set."""
    answer: dict[str, frozenset[str]] = {}
    with_it = [slugs - {UNKNOWN} for slugs in posterior.sets if slug in slugs]
    for slugs, share in posterior.sets.items():
        bare = slugs - {UNKNOWN}
        if slug in bare or share < MENTIONED * (1.0 - MENTIONED):
            continue
        for other in with_it:
            instead = bare - other
            if len(instead) == 1 and other - bare == {slug}:
                answer.setdefault(next(iter(instead)), bare)
    return dict(list(answer.items())[: MOST_LISTED - 1])


def _unknown(problem: Problem, posterior: Posterior, chosen: Chosen) -> Missing:
    """Describe a discrepancy by its channels and the variables that it depends on."""
    parts = dependence(problem, chosen.discrepancy or posterior.discrepancies[chosen.hypothesis.slugs])
    where = "; ".join(
        f"{CHANNELS[channel]} differs by {size:.2g} times its noise, mostly with {variable}"
        for channel, variable, size in parts
    )
    measurement = propose_drive(problem.samples.drive, parts[0][1] if parts else "slip")
    return Missing(
        UNKNOWN, UNKNOWN, "smooth discrepancy", posterior.unknown, {}, "a polynomial in what the drive varies",
        "M. C. Kennedy, A. O'Hagan (2001)", (), measurement, where,
    )  # fmt: skip


def _parameters(problem: Problem, found: Search, best: Hypothesis, effect: Effect) -> dict[str, Estimate]:
    """Parameters of an effect; their variance includes that between hypotheses with the same form."""
    where = _slice_of(best, effect.name)
    values, variance = best.fitted.vector[where], np.diag(best.fitted.covariance(problem))[where].copy()
    holding = [each for each in found.hypotheses if effect.name in each.names]
    logs = np.array([found.log_posterior(each) for each in holding])
    weights = np.exp(logs - logs.max())
    for weight, each in zip(weights / weights.sum(), holding, strict=True):
        variance += weight * (each.fitted.vector[_slice_of(each, effect.name)] - values) ** 2
    sd = np.sqrt(np.maximum(variance, 0.0))
    return {
        parameter.name: Estimate(float(value), float(deviation), parameter.unit)
        for parameter, value, deviation in zip(effect.parameters, values, sd, strict=True)
    }


def _slice_of(hypothesis: Hypothesis, name: str) -> slice:
    """Slice of an effect's parameters in a hypothesis's vector."""
    return next(where for effect, where in hypothesis.fitted.model.slices() if effect.name == name)


def _grounds(
    problem: Problem, best: Hypothesis, found: Search, posterior: Posterior
) -> tuple[ExplainedGround, ...]:  # fmt: skip
    """Grounds with their soils."""
    rows = np.bincount(problem.samples.drive.ground[problem.seen.any(axis=1)], minlength=problem.grounds)
    soils, textbook = soils_of(problem, best, posterior), soils_of(problem, found.textbook, None)
    return tuple(
        ExplainedGround(each.class_name, each.start_s, each.end_s, int(n), soil, bare)
        for each, n, soil, bare in zip(problem.samples.grounds, rows, soils, textbook, strict=True)
    )


def soils_of(problem: Problem, best: Hypothesis, posterior: Posterior | None) -> list[dict[str, Estimate]]:
    """Soils of a hypothesis by ground; with a `posterior` their variance includes that between probable sets."""
    soils = best.fitted.model.soils
    values, variance = best.fitted.vector[soils], np.diag(best.fitted.covariance(problem))[soils].copy()
    if posterior is not None:
        for slugs, share in posterior.sets.items():
            variance += share * (posterior.best[slugs - {UNKNOWN}].fitted.vector[soils] - values) ** 2
    by_ground = zip(values.reshape(-1, SOIL_COUNT), variance.reshape(-1, SOIL_COUNT), strict=True)
    return [_soil_of(problem, *each) for each in by_ground]


def _soil_of(problem: Problem, values: np.ndarray, variance: np.ndarray) -> dict[str, Estimate]:
    """Soil from values and variances (5,) in internal coordinates."""
    answer = {}
    for index, name in enumerate(PARAMETERS):
        value = from_internal(name, float(values[index]))
        sd = math.sqrt(max(float(variance[index]), 0.0)) * abs(slope_of_internal(name, value))
        if name in problem.known.values and not problem.known.sd.get(name):
            sd = 0.0
        answer[name] = Estimate(value, sd, _SOIL_UNITS[name])
    return answer


def _candidates(
    problem: Problem, found: Search, posterior: Posterior, before: HeldOut
) -> tuple[Candidate, ...]:  # fmt: skip
    """Return all hypotheses but the textbook wheel, without and with a discrepancy; their probabilities exclude each
    other.
    """
    logs = [found.log_posterior(each) for each in found.hypotheses]
    of_set: dict[frozenset[str], float] = {}
    for each, log in zip(found.hypotheses, logs, strict=True):
        of_set[each.slugs] = float(np.logaddexp(of_set.get(each.slugs, -math.inf), log))
    answer = []
    for each, log in zip(found.hypotheses, logs, strict=True):
        if each.effects:
            share = posterior.sets[each.slugs] * math.exp(log - of_set[each.slugs])
            kind = "instrument" if {effect.kind for effect in each.effects} == {"instrument"} else "physics"
            name, gain = _joined(each), math.nan
            if share >= MENTIONED:
                gain = hold_out(problem, each.fitted).gain(before)[0]
            answer.append(Candidate(name, kind, share, each.log_evidence, gain, _parameters_by_name(problem, each)))
    for slugs, added in posterior.discrepancies.items():
        base, share, gain = posterior.best[slugs], posterior.sets[slugs | {UNKNOWN}], math.nan
        if share >= MENTIONED:
            gain = hold_out(problem, base.fitted, discrepant=True).gain(before)[0]
        name = f"{_joined(base)} + {UNKNOWN}" if slugs else UNKNOWN
        answer.append(Candidate(name, UNKNOWN, share, base.log_evidence + added.log_evidence, gain, {}))
    return tuple(sorted(answer, key=lambda each: (-each.probability, -each.evidence_nats)))


def _joined(hypothesis: Hypothesis) -> str:
    return " + ".join(effect.name for effect in hypothesis.effects)


def _parameters_by_name(problem: Problem, hypothesis: Hypothesis) -> dict[str, Estimate]:
    """Parameters of all effects, with the effect's name where there are several."""
    sd = np.sqrt(np.maximum(np.diag(hypothesis.fitted.covariance(problem)), 0.0))
    return {
        (f"{effect.slug}.{parameter.name}" if len(hypothesis.effects) > 1 else parameter.name): Estimate(
            float(value), float(error), parameter.unit
        )
        for effect, where in hypothesis.fitted.model.slices()
        for parameter, value, error in zip(
            effect.parameters, hypothesis.fitted.vector[where], sd[where], strict=True
        )
    }  # fmt: skip


def noise_of(problem: Problem, fitted: Fitted, position: int) -> float:
    """Expected error of a channel in held-out rows, SI: by the sensor, by load and slip, and by the ground."""
    sensitivities = problem.reference or fitted.response
    channel = problem.answers[position]
    derivatives = (each[:, channel] for each in (sensitivities.by_latent, sensitivities.by_ground))
    by_latent, by_ground = map(np.nan_to_num, derivatives)
    samples = problem.samples
    uncertain = sum(
        by_latent[:, index] ** 2 * (path.covariance[:, 0, 0] + latent.white)
        for index, (path, latent) in enumerate(((samples.load, problem.load), (samples.slip, problem.slip)))
    )
    varying = by_ground**2 @ fitted.noise.ground_sd**2
    return math.sqrt(float(fitted.noise.sd[position]) ** 2 + float(np.mean(uncertain + varying)))


def _fits(
    problem: Problem, before: np.ndarray, after: np.ndarray, fitted: Fitted, rng: np.random.Generator
) -> dict[str, ChannelFit]:
    answer = {}
    block = np.unique(problem.samples.block, return_inverse=True)[1]
    count = int(block.max()) + 1
    drawn = rng.integers(0, count, (_RESAMPLES, count))
    for position, channel in enumerate(problem.answers):
        values = []
        for residual in (before, after):
            good = np.isfinite(residual[:, position])
            rows = np.bincount(block[good], minlength=count)
            squares = np.bincount(block[good], residual[good, position] ** 2, count)
            resampled = np.sqrt(squares[drawn].sum(axis=1) / np.maximum(rows[drawn].sum(axis=1), 1))
            low, high = np.quantile(resampled, [0.025, 0.975])
            values.append((math.sqrt(squares.sum() / max(good.sum(), 1)), (float(low), float(high))))
        (rmse_before, before_interval), (rmse_after, after_interval) = values
        answer[CHANNELS[channel]] = ChannelFit(
            rmse_before, rmse_after, noise_of(problem, fitted, position), int(problem.seen[:, position].sum()),
            before_interval, after_interval,
        )  # fmt: skip
    return answer


def _rows(problem: Problem, before: np.ndarray, after: np.ndarray, fitted: Fitted) -> Rows:
    drive = problem.samples.drive
    named = {name: getattr(drive, attribute) for name, attribute in names_of(drive).items()}
    named |= {"wheel_angle_rad": drive.wheel_angle_rad, "sinkage_m": fitted.response.channels[:, 2]}
    seen = {name: values for name, values in named.items() if np.isfinite(values).any()}
    measured = np.where(problem.seen, problem.measured, np.nan)
    return Rows(
        tuple(CHANNELS[channel] for channel in problem.answers), seen, measured, measured - before, measured - after,
        np.array([noise_of(problem, fitted, position) for position in range(len(problem.answers))]),
    )  # fmt: skip


def _notes(problem: Problem, fitted: Fitted, chosen: Chosen, gross: int) -> list[str]:
    """Notes on the variation of the ground, the autocorrelation of the noise, and what held-out rows do not test."""
    notes = [f"{gross} values are gross errors: the errors of held-out rows leave them out"] if gross else []
    stiffness, strength = fitted.noise.ground_sd
    if max(stiffness, strength) >= 0.02:
        drive = problem.samples.drive
        unit = "m" if np.array_equal(problem.samples.position, drive.place_m) else "s"
        where = f"along the track, over {fitted.noise.length:.2g} {unit}" if drive.timed else "from trial to trial"
        notes.append(
            f"ground varies {where}: stiffness by {100.0 * stiffness:.1f} %, strength by {100.0 * strength:.1f} % "
            "(standard deviation)"
        )
    each = zip(problem.answers, fitted.noise.autocorrelation, strict=True)
    correlated = [f"{rho:.2f} in {CHANNELS[channel]}" for channel, rho in each if rho > 0.1]
    if correlated:
        notes.append(f"sensor noise is autocorrelated from row to row: {', '.join(correlated)}")
    if chosen.after.untested:
        notes.append("a parameter is determined by one block alone: held-out rows do not test it")
    return [*notes, *(effect.remark for effect in chosen.hypothesis.effects if effect.remark)]
