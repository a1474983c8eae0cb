"""Bevameter: an instrument made of a ground vehicle.

This is the front door that planners import from. Public names load on first use, so that
``import bevameter`` stays fast.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

__version__ = "0.1.0"

_PUBLIC = {
    "BevameterError": "framework.core.errors",
    "InputError": "framework.core.errors",
    "ClassEvidence": "framework.core.evidence",
    "SoilEstimate": "framework.core.soil",
    "SoilKnowledge": "framework.core.soil",
    "Vehicle": "framework.core.vehicle",
    "Wheel": "framework.core.vehicle",
    "load_vehicle": "framework.core.vehicle",
    "Recording": "framework.core.recording.types",
    "WheelTable": "framework.core.recording.types",
    "read_recording": "framework.core.recording.readers",
    "inspect_recording": "framework.inspection",
    "TerrainDatabase": "database.store",
    "LiveTraverse": "framework.live.live",
    "run_traverse": "framework.traverse",
    "run_traverses": "framework.batch",
    "FailedRecording": "framework.batch",
    "simulate": "identification.simulate",
    "identify": "framework.identify",
    "explain": "framework.explain",
    "AugmentedSimulator": "identification.effects.stored",
    "OnlineIdentifier": "identification.estimate.online",
}

if TYPE_CHECKING:
    from .database.store import TerrainDatabase as TerrainDatabase
    from .framework.batch import FailedRecording as FailedRecording
    from .framework.batch import run_traverses as run_traverses
    from .framework.core.errors import BevameterError as BevameterError
    from .framework.core.errors import InputError as InputError
    from .framework.core.evidence import ClassEvidence as ClassEvidence
    from .framework.core.recording.readers import read_recording as read_recording
    from .framework.core.recording.types import Recording as Recording
    from .framework.core.recording.types import WheelTable as WheelTable
    from .framework.core.soil import SoilEstimate as SoilEstimate
    from .framework.core.soil import SoilKnowledge as SoilKnowledge
    from .framework.core.vehicle import Vehicle as Vehicle
    from .framework.core.vehicle import Wheel as Wheel
    from .framework.core.vehicle import load_vehicle as load_vehicle
    from .framework.explain import explain as explain
    from .framework.identify import identify as identify
    from .framework.inspection import inspect_recording as inspect_recording
    from .framework.live.live import LiveTraverse as LiveTraverse
    from .framework.traverse import run_traverse as run_traverse
    from .identification.effects.stored import AugmentedSimulator as AugmentedSimulator
    from .identification.estimate.online import OnlineIdentifier as OnlineIdentifier
    from .identification.simulate import simulate as simulate

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> object:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_PUBLIC[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
