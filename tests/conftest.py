"""Fixtures that all tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings beside the project; tests that need it skip where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the recordings of ../shared/data are not on this machine")
    return SHARED_DATA


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20261121)


@pytest.fixture(scope="session")
def short_drive(tmp_path_factory) -> Path:
    """The `short` scenario: 70 s over sand, loam and grass, each fault once."""
    from bevameter.framework.scenario.write import write_scenario

    return write_scenario("short", tmp_path_factory.mktemp("drive") / "short", seed=4)


@pytest.fixture(scope="session")
def small_models(tmp_path_factory) -> Path:
    """The default models from a sixth of their material: a folder for --models."""
    from bevameter.framework.default_models import train_default

    folder = tmp_path_factory.mktemp("models")
    for sense in ("vision", "audio"):
        train_default(sense, sites_per_class=4).save(folder / f"{sense}.skops")
    return folder
