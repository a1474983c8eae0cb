"""The answer put together from what was fitted, held out and weighed."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...effects.uncatalogued import Uncatalogued
from ...mechanics.textbook import CHANNELS
from ..explanation import Candidate, ChannelFit, Estimate, Explanation, Missing, Region, Rows, Screened, Verdict
from ..fit.fitting import Fitted, Problem
from ..fit.trial import NOT_EXCLUDED, Trial, temperature
from ..locate.coming_round import ALONG_TRACK, located
from ..locate.noise_floor import noise_floor
from ..locate.play import BEHIND_PLAY
from ..locate.smooth_correction import SmoothCorrection
from ..locate.variables import CONSTANT, LAG, names_of
from ..name.naming import ASSERTED, MENTIONED, UNKNOWN, Naming, instead, why_not
from ..name.tries import Search
from ..name.would_tell import would_tell
from . import readable
from .estimates import parameters, parameters_among, soil_of
from .notes import notes_of
from .shape import shape_of
from .wording import summarise, trust

_MOST_LISTED = 6
"""Effects that are listed where the data cannot tell, or that one stands for; all that were considered are among the
candidates."""

_ANSWERS = (CONSTANT, LAG, "sinkage_m")
"""Variables that no drive varies by itself."""

_RESAMPLES = 400

_KINDS = (UNKNOWN, "physics", "instrument")
"""Kinds of effects, that first which stands for a set of several."""


def assemble(
    problem: Problem, found: Search, naming: Naming, remaining: SmoothCorrection, regions: tuple[Region, ...], *,
    source: str, seed: int, began: float, before: np.ndarray, problems: tuple[str, ...] = (),
    simulated: np.ndarray | None = None, repeated: float = 1.0, doubted: tuple[str, ...] = (),
) -> Explanation:  # fmt: skip
    """Put the answer together.

    Parameters
    ----------
    problem, found, naming, remaining, regions
        From the steps before.
    source, seed, began, problems
        The recording, the seed of resampling, when work began [s], and what the reader noticed.
    before : (n, m)
        Residuals that the simulation leaves of rows held out.
    simulated : (n, 5)
        Residuals of another simulator, which then stand for "before".
    repeated
        Number of neighbouring rows that say the same.
    doubted
        What speaks against the chosen set, in words.
    """
    chosen, textbook = found.chosen, found.textbook
    unknown_wins = naming.unknown > 0.5
    held = np.nan_to_num(remaining.held_out) if unknown_wins else 0.0
    after = chosen.held_out.residuals - held
    missing = _missing(problem, found, naming, remaining)
    verdict = _verdict(missing)
    unsure: list[str] = []
    if verdict in ("physics", "instrument"):
        # What is asserted only; look-alikes of the rest are among the candidates.
        asserted = _asserted(missing, naming)
        told = {slug for each in asserted for slug in (each.effect, *each.indistinguishable_from)}
        unsure = [each.effect for each in missing if each.effect not in told and each.kind != UNKNOWN]
        others = _MOST_LISTED - 1
        missing = tuple(replace(e, indistinguishable_from=e.indistinguishable_from[:others]) for e in asserted)
    if verdict == "cannot_tell":
        missing = _most_probable(missing, naming)
    if verdict == "unknown":
        missing = tuple(each for each in missing if each.probability >= MENTIONED)
    if verdict == "none":
        after, regions = before, ()
    before = before if simulated is None else simulated[:, problem.answers]
    fits = _fits(problem, before, after, chosen.fitted, np.random.default_rng(seed))
    gained = (chosen.gain, chosen.held_out.gain(textbook.held_out)[1]) if verdict != "none" else (0.0, 0.0)
    if unknown_wins:
        regions = located(regions, remaining.terms, {name: each.noise for name, each in fits.items()})
        gained = gained[0] + remaining.gain, math.hypot(gained[1], remaining.gain_sd)
    best = chosen if verdict != "none" else textbook
    listed = {each.effect for each in missing}
    explained = Explanation(
        source=source,
        verdict=verdict,
        summary="",
        soil=soil_of(problem, best.fitted, found, naming),
        soil_textbook=soil_of(problem, textbook.fitted),
        trust="",
        located=regions,
        missing=missing,
        candidates=_candidates(found, naming, remaining, repeated),
        screened=tuple(Screened(name, nats) for name, nats in sorted(found.passed, key=lambda pair: -pair[1])),
        fits=fits,
        split=problem.samples.split,
        heldout_nats=Estimate(*gained),
        notes=(*problems, *notes_of(problem, found, best, (before, after), listed, unsure, repeated, doubted)),
        rows=_rows(problem, before, after, chosen.fitted),
        simulator=best.fitted.model,
        vector=best.fitted.vector,
        covariance=best.fitted.covariance,
        believed={slug: float(naming.effects.get(slug, 0.0)) for slug in sorted(best.slugs)},
        seconds=time.perf_counter() - began,
        seed=seed,
        n=int(problem.seen.any(axis=1).sum()),
    )
    return replace(explained, summary=summarise(explained), trust=trust(explained))


def _missing(problem: Problem, found: Search, naming: Naming, remaining: SmoothCorrection) -> tuple[Missing, ...]:
    """What was chosen; where an effect is not certain, what looks like it; where none is, all that is probable."""
    answer: list[Missing] = []
    chosen = found.chosen
    for effect in chosen.effects:
        probability = naming.effects.get(effect.slug, 0.0)
        alike = naming.look_alikes.get(effect.slug, ())
        rivals = instead(found, effect.slug)
        tell = ""
        if alike or probability < ASSERTED:
            tell = would_tell(problem, chosen, *([rivals[slug] for slug in alike] or _next_best(found)))
        answer.append(_named(found, naming, chosen, effect, probability, alike, tell))
        if probability < ASSERTED:
            for slug in alike:
                share = naming.effects.get(slug, 0.0)
                if share < MENTIONED or slug in {each.effect for each in answer}:
                    continue
                rest = [each for each in alike if each != slug]
                others = (effect.slug, *rest)
                for other in rivals[slug].effects:
                    if other.slug == slug:
                        apart = would_tell(problem, rivals[slug], chosen, *(rivals[each] for each in rest))
                        answer.append(_named(found, naming, rivals[slug], other, share, others, apart))
                    elif other.expected and other.slug not in chosen.slugs.union(each.effect for each in answer):
                        beside = naming.effects.get(other.slug, 0.0)
                        if beside >= MENTIONED:
                            answer.append(_named(found, naming, rivals[slug], other, beside, (), ""))
    if answer and all(each.probability < ASSERTED for each in answer):
        answer += _elsewhere(problem, found, naming, {each.effect for each in answer})
    # What may be nothing at all is not a finding; beside an effect it is a rival.
    if remaining.terms and naming.unknown > (MENTIONED if answer else 0.5):
        answer.append(_unknown(naming, remaining))
    answer.sort(key=lambda each: -each.probability)
    return tuple(answer)


def _next_best(found: Search) -> list[Trial]:
    """What gains most, if it is not excluded, without all that was chosen: from it is told what is doubted without
    having a look-alike.
    """
    chosen = found.chosen
    least = chosen.gain - NOT_EXCLUDED * temperature(chosen.gain) * found.dispersion
    others = [trial for trial in found.trials if _not_holding(trial, chosen) and not trial.slugs <= chosen.slugs]
    return sorted((trial for trial in others if trial.gain > least), key=lambda trial: -trial.gain)[:1]


def _not_holding(trial: Trial, chosen: Trial) -> bool:
    return len(trial.unexpected) <= len(chosen.unexpected) and not trial.slugs >= chosen.slugs


def _elsewhere(problem: Problem, found: Search, naming: Naming, listed: set[str]) -> list[Missing]:
    """Effects that are probable in sets which differ from the chosen one by more than one effect."""
    answer = []
    for slug, share in naming.effects.items():
        if share >= MENTIONED and slug not in listed:
            having = [index for index, trial in enumerate(found.trials) if slug in trial.slugs]
            trial = found.trials[max(having, key=lambda index: naming.weights[index])]
            effect = next(each for each in trial.effects if each.slug == slug)
            instead_of = tuple(sorted(found.chosen.slugs - trial.slugs))
            tell = would_tell(problem, found.chosen, trial)
            answer.append(_named(found, naming, trial, effect, share, instead_of, tell))
    return answer


def _most_probable(missing: tuple[Missing, ...], naming: Naming) -> tuple[Missing, ...]:
    """Leave the most probable few of the effects that are listed, or that look like one that is: more tell nothing."""
    listed = {slug for each in missing for slug in (each.effect, *each.indistinguishable_from)} - {UNKNOWN}
    kept = {UNKNOWN, *sorted(listed, key=lambda slug: (-naming.effects.get(slug, 0.0), slug))[:_MOST_LISTED]}
    return tuple(
        replace(each, indistinguishable_from=tuple(slug for slug in each.indistinguishable_from if slug in kept))
        for each in missing
        if each.effect in kept
    )


def _named(
    found: Search, naming: Naming, trial: Trial, effect: Effect, probability: float, alike: tuple[str, ...], tell: str
) -> Missing:
    like = effect.like if isinstance(effect, Uncatalogued) else ""
    return Missing(
        effect.slug, effect.kind, effect.form, probability, parameters_among(found, naming, trial, effect),
        effect.equation, effect.source, alike, effect.check or tell, like,
    )  # fmt: skip


def _unknown(naming: Naming, remaining: SmoothCorrection) -> Missing:
    found = [(term, shape_of(term.channel, term.variable, term.at, term.values)) for term in remaining.terms]
    shapes = "; ".join(shape.words for _, shape in found)
    names = list(dict.fromkeys(term.variable for term in remaining.terms))
    equation = "; ".join(
        f"{term.channel} += {shape.formula or ('a wave' if ' (' in term.variable else 'a spline')}"
        for term, shape in found
    )
    return Missing(
        UNKNOWN, UNKNOWN, "smooth correction", naming.unknown, {}, equation,
        "fitted to the data", (), _alone(names),
        f"{shapes} ({remaining.gain:.0f} nats)",
    )  # fmt: skip


def _alone(names: list[str]) -> str:
    """Say which drive would show the shapes of terms of these variables: what a wheel answers cannot be set."""
    waves = [name for name in names if name.startswith(f"{ALONG_TRACK} (")]
    hangs_back = [name for name in names if name.endswith(BEHIND_PLAY)]
    varied = [part for name in names for part in (("slip", "load_N") if name == "slip x load" else (name,))]
    varied = [name for name in varied if name not in (*_ANSWERS, *waves, *hangs_back)]
    varied = list(dict.fromkeys(_variable(name) for name in varied))
    told = [f"a drive that varies {', then '.join(varied)} with all else held"] if varied else []
    told += ["the same way once more, and beside it: a wave of the ground stays where it is"] if waves else []
    told += ["the same drive there and back in slip and load: what hangs back differs by the way"] if hangs_back else []
    return "; ".join(told)


def _variable(name: str) -> str:
    """Name of a variable in words; a ripple's is the wheel angle, whatever its cycles."""
    return readable.shown(name.partition(" (")[0]).name


def _asserted(missing: tuple[Missing, ...], naming: Naming) -> tuple[Missing, ...]:
    """What is more likely than not, and one of each group that is sure together and in which none is."""
    answer = [each for each in missing if each.probability >= 0.5]
    for each in missing:
        group = {each.effect, *each.indistinguishable_from}
        together = sum(naming.effects.get(slug, 0.0) for slug in group)
        if together >= ASSERTED and each.kind != UNKNOWN and not group & {other.effect for other in answer}:
            answer.append(each)
    return tuple(answer)


def _verdict(missing: tuple[Missing, ...]) -> Verdict:
    sure = [each for each in missing if each.probability >= ASSERTED]
    if not missing:
        return "none"
    if any(each.kind == UNKNOWN for each in sure):
        return "unknown"
    if not sure:
        return "cannot_tell"
    return "physics" if any(each.kind == "physics" for each in sure) else "instrument"


def _candidates(
    found: Search, naming: Naming, remaining: SmoothCorrection, repeated: float
) -> tuple[Candidate, ...]:  # fmt: skip
    answer = []
    for trial, weight in zip(found.trials, naming.weights, strict=True):
        kinds = {effect.kind for effect in trial.effects}
        values = {
            (f"{effect.slug}.{name}" if len(trial.effects) > 1 else name): estimate
            for effect in trial.effects
            for name, estimate in parameters(trial.fitted, effect).items()
        }
        names, kind = " + ".join(effect.name for effect in trial.effects), min(kinds, key=_KINDS.index)
        answer.append(Candidate(names, kind, float(weight), trial.gain, values, why_not(trial, found, repeated)))
    if remaining.terms:
        gain = found.chosen.gain + remaining.gain
        answer.append(
            Candidate(UNKNOWN, UNKNOWN, naming.unknown, gain, {}, "a smooth correction beside what is chosen")
        )
    return tuple(sorted(answer, key=lambda each: (-each.probability, -each.heldout_nats)))


def _fits(
    problem: Problem, before: np.ndarray, after: np.ndarray, chosen: Fitted, rng: np.random.Generator
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
        answer[CHANNELS[channel]] = ChannelFit(
            values[0][0],
            values[1][0],
            noise_floor(problem, chosen, position),
            int(problem.seen[:, position].sum()),
            values[0][1],
            values[1][1],
        )
    return answer


def _rows(problem: Problem, before: np.ndarray, after: np.ndarray, chosen: Fitted) -> Rows:
    drive = problem.samples.drive
    named = {name: getattr(drive, attribute) for name, attribute in names_of(drive).items()}
    named |= {"wheel_angle_rad": drive.wheel_angle_rad, "sinkage_m": chosen.response.channels[:, 2]}
    seen = {name: values for name, values in named.items() if np.isfinite(values).any()}
    measured = np.where(problem.seen, problem.measured, np.nan)
    return Rows(
        tuple(CHANNELS[channel] for channel in problem.answers), seen, measured, measured - before, measured - after,
        np.array([noise_floor(problem, chosen, position) for position in range(len(problem.answers))]),
    )  # fmt: skip
