"""Results that nobody changes any more: read-only arrays and mappings, which other processes can be given."""

from __future__ import annotations

import copyreg
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import MappingProxyType

import numpy as np


def _frozen_mapping(content: dict) -> MappingProxyType:
    return MappingProxyType(content)


# Python does not pickle read-only mappings by itself. A snapshot is full of them, and planners hand it to workers.
copyreg.pickle(MappingProxyType, lambda mapping: (_frozen_mapping, (dict(mapping),)))


def freeze(thing: object) -> None:
    """Make every array of a dataclass read-only, through and through."""
    if isinstance(thing, np.ndarray):
        thing.setflags(write=False)
    elif isinstance(thing, Mapping):
        for value in thing.values():
            freeze(value)
    elif is_dataclass(thing):
        for entry in fields(thing):
            freeze(getattr(thing, entry.name))
