"""Which further effects are sought beside which: not beside the best one alone, which may stand in for two."""

from __future__ import annotations

from collections.abc import Sequence

from ..fit.trial import ASKED_FOR, EXPECTED_ASKED_FOR, Trial, without
from .asked import MOST_ASKED_FOR, is_bump, surplus
from .singles import other_forms, runners_up
from .tries import Tries, gain_of, without_bumps

_WORTH_ANOTHER = 5.0
"""What a second effect has to promise more beside another form of an effect than beside the best one [nats]."""

_PARTNERS, _CLOSE = 2, 0.02
"""Effects that did nearly as well beside the best one, beside which others are sought in turn, and what share of a gain
is near [-]."""

_BESIDE_EXPECTED, _FAR_BEHIND = 4, 0.25
"""Single effects other than the best beside which what the vehicle's description announces is sought, and what share of
its gain they have [-]."""


def beside_bump(tries: Tries, singles: Sequence[Trial], best: Trial) -> Trial:
    """Try others beside a place that gains most, though nothing shows it to be one: beside a second effect, for which
    the ground's variation stood in, it may be, and that effect without it may be little.
    """
    bump = max(singles, key=gain_of, default=best)
    if bump.gain < max(ASKED_FOR, best.gain) or not is_bump(tries.textbook, bump):
        return best
    both = without_bumps(tries.textbook, tries.attempt(bump, tries.weigh(bump, tries.others(bump.slugs))))
    earned = [trial for trial in both if min(surplus(bump, trial), surplus(best, trial)) >= 0.0]
    for pair in sorted(earned, key=gain_of, reverse=True):
        if surplus(without(tries.problem, tries.textbook, pair, bump.effects[0]), pair) >= 0.0:
            return pair
    return best


def one_more(tries: Tries, singles: Sequence[Trial], best: Trial) -> list[Trial]:
    """Try one more effect beside the best set; beside other forms of a single effect, and runners-up, too."""
    effects = tries.others(best.slugs) + tries.laid_out(best)
    promised = tries.weigh(best, [effect for effect in effects if not effect.expected])
    answer = tries.attempt(best, promised, rival=best)
    answer += _beside_expected(tries, singles, best)
    if len(best.effects) != 1:
        return answer
    beside_best = {effect.name: nats for nats, effect in promised if effect.nested}
    for form in other_forms(singles, *best.effects):
        again = tries.weigh(form, [effect for _, effect in promised if effect.nested])
        # What the form is behind has to be made up.
        behind = best.gain - form.gain + _WORTH_ANOTHER
        better = [(nats, e) for nats, e in again if nats - behind > max(beside_best[e.name], ASKED_FOR)]
        answer += tries.attempt(form, better, rival=best)
    # The best one, too, where the runner-up promised little beside it, and its other forms: one may stand in for two.
    for second in runners_up(singles, best):
        tried = {trial.effects[0].name for trial in answer if trial.slugs > second.slugs}
        answer += _weighed_beside(tries, second, best, second.slugs, frozenset(tried))
    return answer + _beside_partners(tries, singles, best, answer)


def _beside_expected(tries: Tries, singles: Sequence[Trial], best: Trial) -> list[Trial]:
    """Try what the vehicle's description announces beside the best set, and other single effects beside it in turn."""
    expected = [effect for effect in tries.catalogue if effect.expected and effect.slug not in best.slugs]
    bases = [best]
    if len(best.effects) == 1:
        first = {trial.slugs: trial for trial in sorted(singles, key=gain_of)}
        near = [trial for trial in first.values() if trial.gain >= _FAR_BEHIND * best.gain]
        others = [trial for trial in near if trial.unexpected and trial.slugs != best.slugs]
        bases += sorted(others, key=lambda trial: -trial.gain)[:_BESIDE_EXPECTED]
    answer: list[Trial] = []
    for base in bases if expected else ():
        answer += tries.attempt(base, tries.weigh(base, expected), EXPECTED_ASKED_FOR, rival=best)
    alone = max((trial for trial in singles if not trial.unexpected), key=gain_of, default=best)
    if len(best.effects) == 1 and alone.slugs != best.slugs and alone.gain >= EXPECTED_ASKED_FOR:
        # What lugs as announced stand beside may be what only a fit tells: one effect beside them is no more than one.
        for form in (alone, *other_forms(singles, *alone.effects)):
            answer += _weighed_beside(tries, form, best, best.slugs | alone.slugs, only_nested=not form.as_announced)
    return answer


def _weighed_beside(
    tries: Tries, base: Trial, best: Trial, taken: frozenset[str], tried: frozenset[str] = frozenset(), *,
    only_nested: bool = True,
) -> list[Trial]:  # fmt: skip
    """Try effects beside a set, not `taken` and whose form was not `tried`: what can be weighed from nothing."""
    others = [e for e in tries.others(taken) if (e.nested or not only_nested) and e.name not in tried]
    return tries.attempt(base, tries.weigh(base, others), rival=best)


def _beside_partners(tries: Tries, singles: Sequence[Trial], best: Trial, larger: Sequence[Trial]) -> list[Trial]:
    """Try others beside effects that gain most beside the best single one, which may stand in for two."""
    first = max(larger, key=gain_of, default=best)
    if first.gain - best.gain < ASKED_FOR:
        return []
    behind = max(MOST_ASKED_FOR, _CLOSE * first.gain)
    known = {first.effects[-1].slug, *best.slugs}.union(*(trial.slugs for trial in runners_up(singles, best)))
    added = [
        trial.effects[-1].slug
        for trial in sorted(larger, key=lambda trial: -trial.gain)
        if first.gain - trial.gain < behind and trial.effects[-1].slug not in known
    ]
    answer: list[Trial] = []
    alone = [[trial for trial in singles if slug in trial.slugs] for slug in dict.fromkeys(added)]
    for forms in [forms for forms in alone if forms][:_PARTNERS]:
        partner = max(forms, key=gain_of)
        answer += _weighed_beside(tries, partner, best, best.slugs | partner.slugs)
    return answer
