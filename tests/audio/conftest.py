"""What the tests of sound share: the generator of its study, which is no part of the package."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

STUDY = Path(__file__).resolve().parents[2] / "tests" / "studies" / "sound_mismatch.py"


@pytest.fixture(scope="session")
def study():
    spec = importlib.util.spec_from_file_location("sound_mismatch", STUDY)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up there
    spec.loader.exec_module(module)
    return module
