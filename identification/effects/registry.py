"""Registry of effects: an effect is one file that registers its class for search, reports, storage and documentation.

An effect of another package is registered in the same way when its module is imported, directly or through an entry
point of the group ``bevameter.effects``.
"""

from __future__ import annotations

import re
from typing import TypeVar, get_args

from ...framework.core.errors import InputError
from ...framework.core.explanation import UNKNOWN
from ..mechanics.textbook import CHANNELS
from .effect import COVARIATES, Effect, Kind, Parameter

REGISTRY: dict[str, type[Effect]] = {}
"""Classes of effects by slug."""

_Effect = TypeVar("_Effect", bound=Effect)

_OF_CLASS, _OF_FORM = ("title", "what_happens", "check"), ("equation", "source")
"""Texts that a class states, and those that each of its forms may state by itself."""

_EXPECTED = (
    f"{', '.join((*_OF_CLASS, *_OF_FORM))}: a text each; kind: {' or '.join(get_args(Kind))}; parameters: a tuple of "
    "one Parameter or several; needs: names of covariates; changes: numbers of channels"
)


def register(effect: type[_Effect]) -> type[_Effect]:
    """Add an effect to the catalogue; a class decorator.

    Raises
    ------
    InputError
        It lacks a slug, title, description or check, or another class has its slug; it has no `forms` of its own, and
        cannot be constructed without arguments or lacks what `check_form` requires.
    """
    name, slug = _name(effect), getattr(effect, "slug", "")
    if not isinstance(slug, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", slug) or slug == UNKNOWN:
        raise InputError(name, f"slug {slug!r}", expected=f"lower-case letters, digits and _, not {UNKNOWN}")
    known = REGISTRY.get(slug, effect)
    if _name(known) != name:
        raise InputError(name, f"slug {slug!r}", expected=f"another slug: {known.__module__} has this one")
    lacking = _without_text(effect, _OF_CLASS)
    if effect.forms.__func__ is Effect.forms.__func__:
        try:
            form = effect()
        except Exception as error:  # whatever the constructor of another package raises
            expected = "a constructor without arguments, or `forms` of its own"
            raise InputError(name, f"cannot be constructed: {error}", expected=expected) from error
        lacking += _lacking(form)
    if lacking:
        raise InputError(name, f"lacks a valid {', '.join(lacking)}", expected=_EXPECTED)
    REGISTRY[slug] = effect
    return effect


def check_form(form: Effect) -> Effect:
    """Return a form of an effect that is complete: classes with `forms` of their own are checked as these are built.

    Raises
    ------
    InputError
        It lacks an equation, a source or parameters, or its kind, covariates or channels are none.
    """
    if lacking := _lacking(form):
        raise InputError(_name(type(form)), f"lacks a valid {', '.join(lacking)}", expected=_EXPECTED)
    return form


def _lacking(form: Effect) -> list[str]:
    """Name the attributes that a form lacks, and those that are not what they have to be."""
    parameters = getattr(form, "parameters", None)
    valid = {
        "kind": form.kind in get_args(Kind),
        "parameters": isinstance(parameters, tuple)
        and len(parameters) > 0
        and all(isinstance(each, Parameter) for each in parameters),
        "needs": isinstance(form.needs, tuple) and set(form.needs) <= set(COVARIATES),
        "changes": isinstance(form.changes, tuple) and set(form.changes) <= set(range(len(CHANNELS))),
    }
    return _without_text(form, _OF_FORM) + [name for name, is_valid in valid.items() if not is_valid]


def _without_text(effect: Effect | type[Effect], names: tuple[str, ...]) -> list[str]:
    texts = {name: getattr(effect, name, None) for name in names}
    return [name for name, text in texts.items() if not (isinstance(text, str) and text.strip())]


def _name(effect: type[Effect]) -> str:
    return f"{effect.__module__}.{effect.__qualname__}"
