"""Registry of effects: an effect is one file that registers its class for search, reports, storage and documentation.

An effect of another package is registered in the same way when its module is imported, directly or through an entry
point of the group ``bevameter.effects``.
"""

from __future__ import annotations

import re
from typing import TypeVar

from ...framework.core.errors import InputError
from .effect import Effect

REGISTRY: dict[str, type[Effect]] = {}
"""Classes of effects by slug."""

RESERVED = "unknown"
"""Name of a discrepancy that no effect of the catalogue explains."""

_Class = TypeVar("_Class", bound=type[Effect])
_TEXTS = ("title", "what_happens", "check")


def register(effect: _Class) -> _Class:
    """Add an effect to the catalogue; a class decorator.

    Raises
    ------
    InputError
        It lacks a slug, title, description or check, or another class has its slug.
    """
    name, slug = f"{effect.__module__}.{effect.__qualname__}", getattr(effect, "slug", "")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", slug) or slug == RESERVED:
        raise InputError(name, f"slug {slug!r}", expected=f"lower-case letters, digits and _, not {RESERVED}")
    known = REGISTRY.get(slug, effect)
    if (known.__module__, known.__qualname__) != (effect.__module__, effect.__qualname__):
        raise InputError(name, f"slug {slug!r}", expected=f"another slug: {known.__module__} has this one")
    for text in _TEXTS:
        if not getattr(effect, text, ""):
            raise InputError(name, f"no {text}", expected=f"a text: {', '.join(_TEXTS)}")
    REGISTRY[slug] = effect
    return effect
