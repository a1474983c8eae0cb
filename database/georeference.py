"""Where on Earth a site's frame lies, and the libraries that exports to maps need."""

from __future__ import annotations

import importlib
from typing import Any

from ..framework.core.errors import InputError
from ..framework.core.origin import Origin

__all__ = ["Origin", "geographic_library"]


def geographic_library(name: str) -> Any:
    """Import a library of the extra `geo`; raises `InputError` where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(name, "is not installed", expected='pip install "bevameter[geo]"') from error
