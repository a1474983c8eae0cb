"""The catalogue: one module an effect, found by itself, and the effects of plug-ins."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules

from ....framework.core.errors import InputError
from ....framework.core.plugins import load_plugins
from ..effect import Effect, Situation
from ..grouped import in_one_group
from ..registry import REGISTRY, check_form

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
for _slug in sorted(REGISTRY, key=lambda slug: (REGISTRY[slug].kind != "physics", slug)):
    REGISTRY[_slug] = REGISTRY.pop(_slug)
load_plugins("bevameter.effects")

SLUGS = REGISTRY.keys()
"""Public names of all effects that are registered, whenever: physics first."""


def effects_for(situation: Situation, slugs: Iterable[str] = SLUGS) -> list[Effect]:
    """Give all forms of the effects named that a recording can show, of all rows and of groups of these.

    Raises
    ------
    InputError
        A name is not in the catalogue, or a form of an effect is incomplete.
    """
    wanted = set(slugs)
    for slug in sorted(wanted):
        effect_class(slug)
    forms = [check_form(form) for slug in SLUGS if slug in wanted for form in REGISTRY[slug].forms(situation)]
    return [each for form in forms for each in (form, *in_one_group(form, situation))]


def forms_by_name(slug: str, situation: Situation) -> list[Effect]:
    """Give all forms of one effect that can be simulated where the situation's drive has what they need.

    Raises
    ------
    InputError
        The name is not in the catalogue, or a form of the effect is incomplete.
    """
    found: dict[tuple[str, ...], Effect] = {}
    following = list(effect_class(slug).forms_by_name(situation))
    while following:
        form = check_form(following.pop(0))
        key = (form.form, *(parameter.name for parameter in form.parameters))
        if key not in found:
            found[key] = form
            following += form.extensions()
    return list(found.values())


def effect_class(slug: str) -> type[Effect]:
    """Give the class of an effect by its public name.

    Raises
    ------
    InputError
        The name is not in the catalogue.
    """
    if slug not in REGISTRY:
        raise InputError("effects", repr(slug), expected="one of " + ", ".join(SLUGS))
    return REGISTRY[slug]
