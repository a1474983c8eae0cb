"""From held-out scores to statements: which effects are asserted, with what probability, and what looks like them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from ..fit.trial import ASKED_FOR, TEMPERATURE, UNHEARD_OF, Trial, temperature
from .asked import MOST_ASKED_FOR, counting_for, is_bump, rests_on_ground, surplus
from .preferred import says_no_more, whole_law
from .tries import Search

UNKNOWN = "unknown"

PENALTY = 4.0
"""Log-odds in nats of held-out score against each further effect, before any data."""

ASSERTED = 0.8
"""An effect is asserted where its probability is at least this; below, the answer is that the data cannot tell."""

MENTIONED = 0.05
"""Look-alikes of at least this probability are listed."""

_TOLERATED = 0.06
"""Share of an effect's gain that a smooth correction may add to it before the effect is doubted: published forms of one
effect differ by about as much."""

_MOST_TOLERATED = 90.0
"""At most so many nats, divided among the effects of a set: of the study's recordings whose effect is in the catalogue
98 % leave less than 26, of those whose effect had been taken out two in five leave more than 90."""

REMAINS = 25.0
"""Nats that a smooth correction has to add before something unknown is spoken of: of 377 of the study's recordings in
which one effect was found one left more, of 23 that left anything once the true effect was taken out 22 did. Up to
what is tolerated a set is doubted and no more (`evidence.doubts`): of 348 right answers (seeds 170000 and 200000) two
left so much, both little of what they gained."""

_UNTHOUGHT_OF = 0.035
"""Least probability of something that the catalogue lacks [-]: of what was stated of the study's recordings three in a
hundred were wrong, however strong the evidence."""

_BESIDE_UNKNOWN = 0.4
"""Most that an effect is believed in beside something that the catalogue lacks: it may stand in for that [-]."""

_AT_ODDS = 0.5
"""Where something (`evidence.doubts`) speaks against what fits best, all that was tried is together believed in no more
than that [-]."""

_UNASKED = 0.5
"""As much where held-out data ask for nothing [-]."""

_TO_WHOLE_LAW = 0.46
"""Share that an effect gives up, of which nothing shows but what another's whole law says, to that other [-]: friction
of a drive follows load and speed, and a torque that is off by the same whatever these are may be friction of which
neither shows, or a zero. Of two that weigh alike one has e times the probability of the other then."""

MANY, _OF_MANY = 3, 0.7
"""As much where so many effects are needed together [-]: of the study's recordings one in 150 needed
three, with their catalogue complete, of those whose effect had been taken out of it one in five."""


@dataclass(frozen=True)
class Naming:
    """Probabilities: of each effect being among what was left out, and of something that the catalogue lacks.

    Parameters
    ----------
    effects
        Probability of each slug, the most probable first, alone or with others.
    unknown
        That the chosen set does not explain the mismatch.
    look_alikes
        For each chosen slug, those that could stand in its place, the most probable first.
    weights : (t,)
        Probability of each trial of the search being all that was left out.
    """

    effects: dict[str, float]
    unknown: float
    look_alikes: dict[str, tuple[str, ...]]
    weights: np.ndarray


def name(
    search: Search, remaining: float, alone: float = np.inf, *, repeated: float = 1.0, doubted: bool = False
) -> Naming:
    """Weigh the trials of a search.

    Parameters
    ----------
    search
        Every set that was tried.
    remaining
        Nats that a smooth correction gains on top of the chosen set.
    alone
        Nats that one gains on the textbook wheel without any effect.
    repeated
        Number of neighbouring rows that say the same: all nats are divided by it, those of sets by `Search.dispersion`
        as well.
    doubted
        Something (`evidence.doubts`) speaks against the chosen set.
    """
    chosen = search.chosen
    unit, nearly = temperature(chosen.gain / repeated), _nearly(search, repeated)
    remaining, alone, gained = remaining / repeated, alone / repeated, chosen.gain / repeated
    against = [PENALTY * max(len(trial.unexpected), 1) + UNHEARD_OF * bool(trial.unheard_of) for trial in search.trials]
    score = np.array([trial.gain for trial in search.trials]) / (repeated * search.dispersion)
    score = np.minimum(score, search.by_errors or np.inf) - np.array(against)
    admitted = np.array([_has_a_say(trial, search) for trial in search.trials], dtype=bool)
    tolerated = min(_TOLERATED * gained, _MOST_TOLERATED / max(len(chosen.unexpected), 1))
    doubt = remaining - max(REMAINS, tolerated)
    top = max(0.0, float(np.max(score[admitted], initial=0.0)))
    weights = _by_best_form(search, np.where(admitted, np.exp((score - top) / unit), 0.0))
    weights = _to_whole_laws(search, weights)
    weights = _with_further(search, weights, repeated)
    nothing = np.exp((0.0 - top) / unit)
    known = weights.sum() + nothing
    # What a smooth correction adds speaks against every set alike.
    unknown = max(float(expit(doubt / (2.0 * TEMPERATURE))), _UNTHOUGHT_OF)
    share = float(weights.sum() / known)
    weights = weights / known * (1.0 - unknown) * min(1.0, _believed(chosen, doubted=doubted) / max(share, 1e-300))
    # Beside something unknown an effect can be right all the same, where no correction does without it.
    beside = _BESIDE_UNKNOWN if gained + remaining - alone > ASKED_FOR else 0.0
    effects: dict[str, float] = {}
    for trial, weight in zip(search.trials, weights, strict=True):
        for slug in trial.slugs:
            effects[slug] = effects.get(slug, 0.0) + float(weight)
    for slug in chosen.slugs:
        effects[slug] += unknown * beside
    effects = dict(sorted(effects.items(), key=lambda pair: -pair[1]))
    look_alikes = {slug: _stand_ins(search, slug, chosen.gain - nearly) for slug in sorted(chosen.slugs)}
    return Naming(effects, unknown, look_alikes, weights)


def _has_a_say(trial: Trial, search: Search) -> bool:
    """Say whether a set has no more effects than held-out data ask for (larger ones that were tried were turned down),
    no place that nothing shows to be one, and does not leave to the ground what the chosen set explains.
    """
    bump = is_bump(search.textbook, trial)
    return _no_larger(trial, search) and not bump and not rests_on_ground(trial, search.chosen)


def _no_larger(trial: Trial, search: Search) -> bool:
    """Say whether a set has no more effects than what is chosen, those aside that the vehicle announces and that gain
    beside the others what is asked of them.
    """
    chosen = search.chosen
    if len(trial.effects) <= max(len(chosen.effects), 1):
        return True
    bare = [each for each in search.trials if each.slugs == trial.unexpected]
    earned = all(surplus(each, trial) >= 0.0 for each in bare)
    return len(trial.unexpected) <= len(chosen.unexpected) and not trial.slugs > chosen.slugs and earned


def _nearly(search: Search, repeated: float) -> float:
    """Nats behind the chosen set up to which another one is mentioned; `repeated` rows count as one."""
    unit = repeated * search.dispersion * temperature(search.chosen.gain / repeated)
    return unit * float(np.log(1.0 / MENTIONED))


def _believed(chosen: Trial, *, doubted: bool) -> float:
    """Most that all that was tried is together believed in, something unknown aside [-]."""
    if not chosen.effects:
        return _UNASKED
    if doubted:
        return _AT_ODDS
    return _OF_MANY if len(chosen.unexpected) >= MANY else 1.0


def _by_best_form(search: Search, weights: np.ndarray) -> np.ndarray:
    """Share among the forms of one set of effects what the best of them weighs, (t,).

    That an effect has been published in many forms, or that forms hold one another, does not make it more probable.
    """
    slugs = [trial.slugs for trial in search.trials]
    best, total = dict.fromkeys(slugs, 0.0), dict.fromkeys(slugs, 0.0)
    for each, weight in zip(slugs, weights.tolist(), strict=True):
        best[each], total[each] = max(best[each], weight), total[each] + weight
    return weights * np.array([best[each] / total[each] if total[each] > 0.0 else 0.0 for each in slugs])


def _to_whole_laws(search: Search, weights: np.ndarray) -> np.ndarray:
    """Weights (t,) with what sets give up that say no more than another one does."""
    answer = weights.copy()
    for number, trial in enumerate(search.trials):
        other = whole_law(search.trials, trial) if weights[number] > 0.0 else None
        if other is not None and weights[other] > 0.0:
            answer[number] -= _TO_WHOLE_LAW * weights[number]
            answer[other] += _TO_WHOLE_LAW * weights[number]
    return answer


def _with_further(search: Search, weights: np.ndarray, repeated: float) -> np.ndarray:
    """Weights (t,) of which the chosen set gives each that holds one more effect its share: that gains something, and
    not what is asked of it, is no proof that it is not there.

    Each has the odds beside the chosen set that the nats leave it which it lacks of what is asked.
    """
    chosen, odds = search.chosen, np.zeros_like(weights)
    own = np.array([trial.slugs == chosen.slugs for trial in search.trials], dtype=bool)
    if not chosen.effects or not own.any():
        return weights
    many, unit = repeated * search.dispersion, temperature(chosen.gain / repeated)
    # What is chosen may be a form that gains a little less than another of the same effects.
    best = max((trial for trial, same in zip(search.trials, own, strict=True) if same), key=lambda trial: trial.gain)
    base = counting_for(best, many)
    for number, trial in enumerate(search.trials):
        one_more = trial.slugs > chosen.slugs and len(trial.slugs) == len(chosen.slugs) + 1
        expected = len(trial.unexpected) == len(chosen.unexpected)
        if not one_more or expected or weights[number] > 0.0 or trial.unheard_of or not np.isfinite(trial.gain):
            continue
        odds[number] = np.exp(min(surplus(base, counting_for(trial, many)), 0.0) / unit)
    odds = _by_best_form(search, odds)
    given = weights[own].sum()
    return np.where(own, weights / (1.0 + odds.sum()), weights) + given * odds / (1.0 + odds.sum())


def _stand_ins(search: Search, slug: str, least: float) -> tuple[str, ...]:
    """Effects that could take one's place in the chosen set and gain more than so much, the best ones first."""
    best = {other: trial.gain for other, trial in instead(search, slug).items() if trial.gain > least}
    return tuple(sorted(best, key=lambda other: -best[other]))


def instead(search: Search, slug: str) -> dict[str, Trial]:
    """Best set with each other effect in one's place in the chosen one: as many, or as many besides what the vehicle
    announces.
    """
    chosen, best = search.chosen, dict[str, Trial]()
    for trial in search.trials:
        for own, ours in ((trial.slugs, chosen.slugs), (trial.unexpected, chosen.unexpected)):
            other = own - (ours - {slug})
            if slug in ours and len(own) == len(ours) and len(other) == 1 and slug not in own:
                name = next(iter(other))
                best[name] = max(best.get(name, trial), trial, key=_counted)
    return best


def _counted(trial: Trial) -> float:
    """Nats that a set gains, less those against what nobody has published."""
    return trial.gain - UNHEARD_OF * bool(trial.unheard_of)


def why_not(trial: Trial, search: Search, repeated: float) -> str:
    """Say why a set that was tried is not the answer."""
    chosen = search.chosen
    if trial.effects == chosen.effects:
        return "chosen"
    if trial.gain < ASKED_FOR:
        return f"held-out data do not ask for it ({trial.gain:+.1f} nats)"
    if len(trial.effects) == 1 and is_bump(search.textbook, trial):
        return f"{trial.gain:.1f} nats, but no edge tells it from ground that varies by itself"
    behind = chosen.gain - trial.gain
    if chosen.effects and rests_on_ground(trial, chosen):
        spread = [100.0 * float(each.fitted.noise.spread.max()) for each in (trial, chosen)]
        return f"leaves to ground that varies by {spread[0]:.0f} % (not {spread[1]:.0f} %) what the chosen set explains"
    asked_for = behind < -MOST_ASKED_FOR or (trial.slugs > chosen.slugs and surplus(chosen, trial) >= 0.0)
    if asked_for and repeated > 1.0:
        return f"gains {-behind:.0f} nats more, but neighbouring rows repeat each other: not so many count"
    if trial.slugs > chosen.slugs:
        return f"adds too little to what is chosen ({-behind:+.1f} nats)"
    if len(trial.unexpected) > len(chosen.unexpected):
        return f"more effects for too little ({-behind:+.1f} nats)"
    if behind < 0.0 and trial.unheard_of:
        return f"{-behind:.1f} nats more, but with {' and '.join(trial.unheard_of)}, beyond what has been published"
    if behind < 0.0 and says_no_more(search.trials, trial) and not says_no_more(search.trials, chosen):
        return f"as good ({-behind:+.1f} nats), but of all that it says only what the chosen set says too shows"
    if behind < 0.0 and trial.slugs == chosen.slugs and len(trial.fitted.vector) > len(chosen.fitted.vector):
        return f"as good: {-behind:.1f} nats more, but by more parameters"
    if behind < 0.0:
        return f"as good: {-behind:.1f} nats more, but larger errors on held-out rows"
    if trial.unheard_of and not chosen.unheard_of:
        return f"{behind:.1f} nats behind, and with {' and '.join(trial.unheard_of)}, beyond what has been published"
    if behind < _nearly(search, repeated):
        return f"nearly as good: {behind:.1f} nats behind"
    return f"explains less: {behind:.0f} nats behind"
