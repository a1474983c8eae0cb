"""Could anybody tell? Which other effects, fitted together with the soil, explain a recording as well as its own.

An effect that leaves hardly more than the truth does cannot be told from it by these data, however well they are read:
an explanation that names it, or says that the two are indistinguishable, is as good as data allow.
"""

from __future__ import annotations

import numpy as np

from .conceal import ConcealedRecording
from .drives import needs_of
from .effects import Effect, Setting, catalogue
from .effects_instrument import Fault, TimeLag
from .mechanics import simulate
from .weighing import refit_textbook, refit_with, vector, weights

CANNOT_TELL = 4.0
"""Below this expected difference in log-likelihood two effects cannot be told apart [nats]: odds of about 50 to 1."""


def rivals(made: ConcealedRecording, slugs: tuple[str, ...] | None = None) -> dict[str, float]:
    """Give the nats by which the truth is still ahead of each other effect refitted with the soil.

    Of each effect every form is tried, at what else it draws (a depth, a place, a channel) once, so that what is found
    is an upper bound.

    Parameters
    ----------
    made
        A recording that hides one effect.
    slugs
        Which effects to try; all others than the hidden one where absent.

    Returns
    -------
    dict
        Nats by slug, the nearest rival first; those whose channels the recording lacks are left out.

    Raises
    ------
    ValueError
        Not one effect is hidden.
    """
    if len(made.effects) != 1:
        raise ValueError(f"{len(made.effects)} effects are hidden, expected one")
    case, own = made.case, made.effects[0]
    _, theta_1 = simulate(case.ground, case.body, case.drive, made.effects)
    weight = weights(case, made.effects, made.clean, theta_1)
    start = refit_textbook(case, made.clean, weight, vector(case.ground)).parameters
    textbook, _ = simulate(case.ground, case.body, case.drive)
    setting = Setting(case.body, case.ground, case.drive, textbook, case.pulls)
    found: dict[str, float] = {}
    for slug, kind in catalogue().items():
        if slug == own.slug or (slugs is not None and slug not in slugs) or not _seen(slug, made):
            continue
        for form in dict.fromkeys(kind.forms):
            for effect in _tries(kind.draw(np.random.default_rng(0), setting, form)):
                fit, _ = refit_with(case, made.clean, weight, effect, start)
                found[slug] = min(found.get(slug, np.inf), fit.nats)
    return dict(sorted(found.items(), key=lambda item: item[1]))


def _seen(slug: str, made: ConcealedRecording) -> bool:
    """Tell whether the recording has what the effect needs to be seen, as far as its columns tell."""
    needs, case = needs_of([slug]), made.case
    varied = {
        "lugs": case.body.lugs > 0, "time": "time_s" in made.recorded.columns, "pull": case.pulls,
        "passes": np.ptp(case.drive.passes) > 0, "pitch": np.ptp(case.drive.pitch_rad) > 0,
    }  # fmt: skip
    return all(varied.get(need, True) for need in needs)


def _tries(effect: Effect) -> list[Effect]:
    """Give an effect at a fifth of what is plausible, a fault of either sign."""
    low, high = effect.bounds
    small = effect.scaled(low + 0.2 * (high - low))
    if not isinstance(small, Fault) or isinstance(small, TimeLag):
        return [small]
    return [small, small.reversed()]
