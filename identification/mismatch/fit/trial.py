"""A set of effects fitted together with the soil, and how it predicts blocks that it was not fitted to."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....framework.core.soil import PARAMETERS, PLAUSIBLE, PUBLISHED, UNDRAINED_C_PA, SoilKnowledge
from ...effects.effect import Effect, Situation
from ...mechanics.augmented import SOIL_COUNT, AugmentedWheel
from ...mechanics.soil import from_internal, to_internal
from .fitting import Fitted, Problem, as_smooth_as_it_is, fit
from .gained_by_none import of_gross_errors, of_quiet
from .held_out import HeldOut, hold_out
from .places import everywhere, stretches_apart
from .samples import Samples
from .soil_variation import HUBER, SMOOTHEST
from .textbook import coarse_fit, first_soil, fit_textbook

ASKED_FOR = 12.0
"""An effect is added where it gains more than this many nats on held-out blocks."""

EXPECTED_ASKED_FOR = 5.0
"""As much of an effect that the vehicle's description announces, beside others [nats]."""

UNHEARD_OF = 8.0
"""Nats against a set with parameters beyond what was published (`Trial.unheard_of`)."""

TEMPERATURE, _FORMS_DIFFER, _MOST_DIFFER = 2.5, 0.003, 3.5
"""Held-out nats that make one unit of log-odds: scores of look-alikes differ by chance, and the more is gained, by how
published forms of one effect differ, here as a share of it [-] and at most [nats]. From the study's training recordings
(docs/concealed-physics.md): where more than 400 nats were gained, a wrong set led by 6 to 12 in 2 of 7."""

NOT_EXCLUDED = 3.0
"""Units of log-odds up to which a set is not excluded, to 5 % [-]."""

_AGREED = 2.0
"""Standard deviations, from block to block, that a delay's gain is from zero where it is one [-]: of the study's
recordings looked at since, seven true ones had 2.5 and more, two of a null 0.9 and 1.6."""

_SHORT, _STILL_MOVING = 5, 3.0
"""Iterations by which starts are compared, and how far behind the best [nats] one has not come to rest by then."""

_CHEAP, _MISFIT = 300, 1.5
"""Rows up to which sets are fitted from other soils, too, and noises that the textbook wheel leaves of them then [-]:
on real sand (27 trials, 2.6 noises) a load gain gains 372 nats from the textbook's soil and 411 from others."""

WORTH_FURTHER = 6.0
"""Nats that further parameters of an effect found have to gain."""

_OUT_OF_REACH, _FAR_BEHIND = 40.0, 0.1
"""Nats behind a rival, and share of what that one gained, from which on it is of no interest how far exactly [-]."""

_BEYOND = 1.64
"""A soil is beyond what was published where its parameter is, by so many of its standard deviations [-]."""

_TOLD = 0.125
"""Standard deviation, as a share of what was published, up to which data tell a soil's parameter at all [-]."""

_AT_BOUND = 0.01
"""Standard deviations off its bound up to which a soil's parameter is stopped by it [-]: a step may end just short."""


@dataclass(frozen=True)
class Trial:
    """A set of effects, its fit and how it predicts.

    `gain` over the textbook wheel [nats] is the lesser of that on held-out blocks and that in the fit: a wrong model
    may fail wildly on a block that the others do not foresee, and what merely calms that failure explains nothing.
    Nor does what is gained on a few values that stay gross errors.
    `soil_unheard_of` says, in words, how the soil beside the effects is unlike any that was measured, and `sharp` how
    many nats of what a place along the track gains are lost where its edges are wide, none where wide ones fit best: a
    model that is wrong otherwise leaves nothing so sharp. So many nats are `rippled`: gained by what comes and goes
    with the wheel's turns.
    """

    effects: tuple[Effect, ...]
    fitted: Fitted
    held_out: HeldOut
    gain: float
    soil_unheard_of: tuple[str, ...] = ()
    sharp: float = 0.0
    rippled: float = 0.0

    @property
    def slugs(self) -> frozenset[str]:
        """Public names of the effects."""
        return frozenset(effect.slug for effect in self.effects)

    @property
    def unexpected(self) -> frozenset[str]:
        """Public names of those that the vehicle's description does not announce."""
        return frozenset(effect.slug for effect in self.effects if not effect.expected)

    @property
    def as_announced(self) -> bool:
        """Whether it holds what the vehicle's description announces, all of which came out as it does."""
        sd = np.sqrt(np.maximum(np.diag(self.fitted.covariance), 0.0))
        announced = [(effect, where) for effect, where in self.fitted.model.slices() if effect.expected]
        as_stated = [effect.as_announced(self.fitted.vector[where], sd[where]) for effect, where in announced]
        return bool(as_stated) and all(as_stated)

    @property
    def steady_gain(self) -> float:
        """Nats that it gains by what does not ripple."""
        return self.gain - self.rippled

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects, forms included."""
        return frozenset(effect.name for effect in self.effects)

    @property
    def unheard_of(self) -> tuple[str, ...]:
        """Parameters, in words, that are beyond what has been published of their effects, and of the soil with them."""
        sd = np.sqrt(np.maximum(np.diag(self.fitted.covariance), 0.0))
        beyond = tuple(
            f"{effect.slug} with {beyond}"
            for effect, where in self.fitted.model.slices()
            for beyond in effect.unheard_of(self.fitted.vector[where], sd[where])
        )
        return beyond + self.soil_unheard_of


def unheard_of_soil(vector: np.ndarray, sd: np.ndarray, known: Iterable[str] = ()) -> tuple[str, ...]:
    """Say, in words, how a soil (5,), internal, known to its standard deviations, is unlike any that was measured.

    What is `known` of it from elsewhere was.
    """
    beyond = []
    for name, (low, high) in PUBLISHED.items():
        if name in known:
            continue
        index = PARAMETERS.index(name)
        at, least, most = vector[index], to_internal(name, low), to_internal(name, high)
        away = max(least - at, at - most)
        # Against its bound it would go on: how far is not known.
        ends = [to_internal(name, end) for end in PLAUSIBLE[name]]
        stopped = min(abs(at - end) for end in ends) <= _AT_BOUND * sd[index] < _AT_BOUND * _TOLD * (most - least)
        undrained = name == "phi_rad" and at < least and vector[0] > UNDRAINED_C_PA
        if away > 0.0 and (stopped or away > _BEYOND * sd[index]) and not undrained:
            value = from_internal(name, float(at))
            told = f"n = {value:.2g}" if name == "n" else f"phi = {math.degrees(value):.1f} deg"
            beyond.append(f"a soil with {told}")
    return tuple(beyond)


def temperature(gained: float) -> float:
    """Nats that make one unit of log-odds between sets that gain so many."""
    return TEMPERATURE + min(_FORMS_DIFFER * max(gained, 0.0), _MOST_DIFFER)


def situation(problem: Problem, textbook: Fitted) -> Situation:
    """Describe the recording to the catalogue."""
    samples = problem.samples
    measured = samples.measured
    innovations = np.full_like(measured, np.nan)
    # A gross error has a share of every line.
    white = np.clip(textbook.innovations, -HUBER, HUBER)
    innovations[:, problem.answers] = np.where(problem.seen, white, np.nan)
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(measured).any(axis=0)
        typical = np.where(seen, np.sqrt(np.nanmean(np.where(seen, measured, 0.0) ** 2, axis=0)), np.nan)
    absent = [channel for channel in (1, 2, 4) if channel not in samples.answers]
    typical[absent] = np.nan
    return Situation(
        samples.wheel,
        samples.drive,
        typical,
        measured[:, 2],
        innovations,
        float(textbook.vector[0]),
        float(textbook.vector[1]),
        math.exp(textbook.vector[3]),
        stretches_apart(problem, textbook),
    )


def textbook_trial(
    samples: Samples, known: SoilKnowledge | None = None, roughest: float = 1.0
) -> tuple[Problem, Trial]:  # fmt: skip
    """Fit the textbook wheel and hold its blocks out; ground varies by `roughest` at most."""
    problem, fitted = fit_textbook(samples, known, roughest)
    return problem, Trial((), fitted, hold_out(problem, fitted), 0.0)


def least_errors(problem: Problem, textbook: Trial) -> np.ndarray:
    """Residuals (n, m), SI, that the textbook wheel leaves of rows held out, by the soil that errs less.

    Where its form is wrong the likeliest soil may be one that leaves large errors, which it takes for ground that
    varies: no simulation that anybody would run.
    """
    coarse = coarse_fit(problem, textbook.fitted.vector, textbook.fitted.theta_1)
    plain = hold_out(problem, coarse)
    return min(textbook.held_out, plain, key=lambda held: held.error(problem)).residuals


def try_adding(
    problem: Problem, textbook: Trial, base: Trial, effect: Effect, rival: float = -math.inf,
    former: Trial | None = None,
) -> Trial:  # fmt: skip
    """Fit a set with one more effect, from each of its starts, and hold its blocks out.

    The further it stays behind the score of a `rival`, the less exactly it is fitted and held out, and one that fits
    worse than the set alone is not held out exactly either. A `former` trial of the same set takes the starts' place.
    """
    best = _from_starts(problem, base, effect, rival, former)
    if former is None and _many_optima(problem, textbook):
        best = max([best, *_from_other_soils(problem, base, effect, max(rival, best.score))], key=_score)
    sharp = base.sharp
    if best.score >= base.fitted.score + ASKED_FOR:
        tried = [best]
        for variant in best.model.effects[-1].variants():
            model, most = AugmentedWheel(best.model.wheel, (*base.effects, variant)), max(rival, best.score)
            tried.append(fit(problem, model, best.vector, best.noise, best.theta_1, rival=most))
            best = max(best, tried[-1], key=_score)
        if effect.local:
            sharp = best.score - tried[-1].score
        best = _freed(problem, base, best, max(rival, best.score))
        best = as_smooth_as_it_is(problem, best, max(rival, best.score))
    behind = rival - best.score > max(_OUT_OF_REACH, _FAR_BEHIND * (rival - textbook.fitted.score))
    worse = best.score <= base.fitted.score
    held_out = hold_out(problem, best, again=not behind and not worse)
    trial = replace(_trial(problem, textbook, best.model.effects, best, held_out), sharp=sharp)
    effect, where = best.model.slices()[-1]
    late = effect.delay(best.vector[where]) is not None
    gained = trial.gain - base.gain
    nothing = worse or (late and (_by_chance(base, trial) or (gained > 0.0 and _either_way(problem, base, trial))))
    return replace(trial, gain=min(trial.gain, base.gain)) if nothing else trial


def _by_chance(base: Trial, trial: Trial) -> bool:
    """Say whether blocks disagree on a delay: averaged errors of load and slip, which go on for rows, favour another
    one in each stretch, and the more the more precise the answers are.
    """
    gained, sd = trial.held_out.gain(base.held_out)
    return gained < _AGREED * sd


def _either_way(problem: Problem, base: Trial, trial: Trial) -> bool:
    """Say whether the opposite of the last effect's delay does better than none, too: rows that are apart are then no
    worse than those that belong together, as where errors of load and slip go on for rows, and nothing is late.

    A delay has no parameter but itself.
    """
    fitted = trial.fitted
    _, where = fitted.model.slices()[-1]
    vector = fitted.vector.copy()
    vector[where] *= -1.0
    opposite = fit(problem, fitted.model, vector, fitted.noise, fitted.theta_1, iterations=0)
    noise = problem.best_noise(opposite.response, opposite.vector, fitted.noise, problem.prior(fitted.model))
    settled = fit(problem, fitted.model, opposite.vector, noise, opposite.theta_1, iterations=0)
    return settled.score > base.fitted.score


def _freed(problem: Problem, base: Trial, best: Fitted, rival: float) -> Fitted:
    """Fit further parameters of the last effect, and keep them where they are worth it; each form has those before."""
    for freer in best.model.effects[-1].freer():
        own = len(best.model.effects[-1].parameters)
        further = [parameter.null for parameter in freer.parameters[own:]]
        model, start = AugmentedWheel(best.model.wheel, (*base.effects, freer)), np.concatenate([best.vector, further])
        free = fit(problem, model, start, best.noise, best.theta_1, rival=rival)
        if free.score > best.score + WORTH_FURTHER:
            # From where it ended the effect without them may fit better, too.
            ended = free.vector[: len(best.vector)]
            best = max(best, fit(problem, best.model, ended, free.noise, free.theta_1, rival=rival), key=_score)
            best = free if free.score > best.score + WORTH_FURTHER else best
    return best


def _from_starts(problem: Problem, base: Trial, effect: Effect, rival: float, former: Trial | None) -> Fitted:
    """Fit a set with one more effect from each of its starts."""
    model = AugmentedWheel(problem.samples.wheel, (*base.effects, effect))
    starts = starts_of(base, effect, former)
    ways = [(model, base.fitted.noise)]
    if effect.local and former is None:
        # With the ground held to vary little at first, whose variation may have explained the place already; and with
        # other edges, for sharp ones stay where they start. The edges may have passed for ground that varies roughly.
        other, first = AugmentedWheel(model.wheel, (*base.effects, effect.variants()[0])), problem.first_noise
        ways += [(model, first), (other, first), (model, replace(first, smooth=0 if first.smooth else SMOOTHEST))]
    theta_1, several = base.fitted.theta_1, len(starts) * len(ways) > 1
    first = partial(fit, problem, theta_1=theta_1, iterations=_SHORT if several else None, rival=rival)
    fits = [max((first(each, start, noise) for each, noise in ways), key=_score) for start in starts]
    fits.sort(key=_score, reverse=True)
    if not several:
        return fits[0]
    followed = 2 if effect.local else 1
    ended = [_to_its_end(problem, each, rival) for each in fits[:followed]]
    if max(map(_score, ended)) < base.fitted.score + ASKED_FOR:
        # The first ones came to rest where the effect is nothing: those that have not are followed to their end.
        slow = [each for each in fits[followed:] if fits[0].score - each.score > _STILL_MOVING]
        ended += [_to_its_end(problem, each, rival) for each in slow]
    return max(ended, key=_score)


def _many_optima(problem: Problem, textbook: Trial) -> bool:
    """Say whether a fit may end far from its best: where the textbook wheel is wrong, soils that hardly carry the load
    take up the misfit, and stop there. Of few rows more starts cost little.
    """
    left = textbook.fitted.innovations[problem.seen]
    return len(problem.seen) <= _CHEAP and float(np.sqrt(np.mean(left**2))) > _MISFIT


def _from_other_soils(problem: Problem, base: Trial, effect: Effect, rival: float) -> list[Fitted]:
    """Fit a set with one more effect from middling soils instead of the set's own."""
    model = AugmentedWheel(problem.samples.wheel, (*base.effects, effect))
    others = base.fitted.vector[SOIL_COUNT:]
    starts = [np.concatenate([soil, others, effect.starts()[0]]) for soil in first_soil(problem)]
    return [fit(problem, model, start, base.fitted.noise, rival=rival) for start in starts]


def _score(fitted: Fitted) -> float:
    return fitted.score


def _to_its_end(problem: Problem, fitted: Fitted, rival: float) -> Fitted:
    """Go on with a fit that was ended early."""
    return fit(problem, fitted.model, fitted.vector, fitted.noise, fitted.theta_1, rival=rival)


def starts_of(base: Trial, effect: Effect, former: Trial | None = None) -> list[np.ndarray]:
    """Vectors from which a set with one more effect may be fitted: its own, or where a former trial ended."""
    soil, others = np.split(base.fitted.vector, [SOIL_COUNT])
    if former is not None:
        own = former.fitted.vector[len(base.fitted.vector) :]
        again = np.concatenate([base.fitted.vector, own])
        return [former.fitted.vector, again]
    return [np.concatenate([effect.beside(soil), others, start]) for start in effect.starts()]


def _trial(
    problem: Problem, textbook: Trial, effects: tuple[Effect, ...], fitted: Fitted, held: HeldOut
) -> Trial:  # fmt: skip
    gain = min(held.gain(textbook.held_out)[0], fitted.score - textbook.fitted.score)
    gain -= sum(effect.sought for effect in effects) + of_quiet(problem, fitted)
    gain -= of_gross_errors(textbook.fitted.innovations, fitted.innovations)
    if everywhere(fitted, problem.samples.drive):
        gain = min(gain, 0.0)
    sd = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    unlike = unheard_of_soil(fitted.vector[:SOIL_COUNT], sd[:SOIL_COUNT], problem.known.values)
    return Trial(effects, fitted, held, gain, unlike, rippled=min(_of_ripples(problem, fitted), max(gain, 0.0)))


def _of_ripples(problem: Problem, fitted: Fitted) -> float:
    """Nats at most that a fit is better than one without its ripples: the noise is found anew, all else stays."""
    rippling = [(effect.ripples, where) for effect, where in fitted.model.slices() if effect.ripples is not None]
    if not rippling:
        return 0.0
    vector = fitted.vector.copy()
    for ripples, where in rippling:
        vector[where][ripples] = 0.0
    return max(fitted.score - fit(problem, fitted.model, vector, None, fitted.theta_1, iterations=0).score, 0.0)


def less(trial: Trial, dropped: Effect) -> tuple[AugmentedWheel, np.ndarray]:
    """Model of a set less one of its effects, and its vector as the set has it."""
    kept = [(effect, where) for effect, where in trial.fitted.model.slices() if effect is not dropped]
    vector = np.concatenate([trial.fitted.vector[:SOIL_COUNT], *[trial.fitted.vector[where] for _, where in kept]])
    return AugmentedWheel(trial.fitted.model.wheel, tuple(effect for effect, _ in kept)), vector


def without(problem: Problem, textbook: Trial, trial: Trial, dropped: Effect) -> Trial:
    """Fit a set less one of its effects."""
    if len(trial.effects) == 1:
        return textbook
    model, vector = less(trial, dropped)
    fitted = fit(problem, model, vector, trial.fitted.noise, trial.fitted.theta_1)
    left = _trial(problem, textbook, model.effects, fitted, hold_out(problem, fitted))
    return replace(left, sharp=0.0 if dropped.local else trial.sharp)


def again(problem: Problem, textbook: Trial, trial: Trial, effects: tuple[Effect, ...] | None = None) -> Trial:
    """Fit a set again, to samples that are others, or laid out otherwise, by `effects` that are the same for them."""
    there = trial.fitted
    model = there.model if effects is None else AugmentedWheel(there.model.wheel, effects)
    fitted = as_smooth_as_it_is(problem, fit(problem, model, there.vector, there.noise))
    return _trial(problem, textbook, model.effects, fitted, hold_out(problem, fitted))
