"""Plug-ins: modules of other distributions that register what they hold, such as effects or readers, when imported."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from functools import _lru_cache_wrapper, cache, wraps
from importlib import metadata


def load_plugins(group: str) -> None:
    """Import what the entry points of a group name; one that cannot be imported is left out, with a warning."""
    for point in metadata.entry_points(group=group):
        fault = import_fault(point)
        if fault:
            origin = point.dist.name if point.dist is not None else "an unknown distribution"
            warnings.warn(
                f"entry point {point.name} = {point.value} of {origin} ({group}) is left out: {fault}", stacklevel=2
            )


def import_fault(point: metadata.EntryPoint) -> str:
    """Import what an entry point names, and say why it cannot be imported; empty where it can."""
    try:
        point.load()
    except Exception as error:  # whatever a module of another distribution raises
        return f"{type(error).__name__}: {error}"
    return ""


def once(load: Callable[[], None]) -> _lru_cache_wrapper[None]:
    """Have a function that fills a registry called once; threads that come meanwhile wait until it is filled."""
    lock = threading.RLock()

    @cache
    @wraps(load)
    def guarded() -> None:
        with lock:  # a thread that waited calls it again, which changes nothing: all modules are imported
            load()

    return guarded
