"""Fixtures that all tests share."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from numba.core.event import Event, Listener, register

MOST_CPU_S = 5.0
"""What a test may use of the processor, with its child processes; compiling kernels and fixtures do not count."""


class CompileTime(Listener):
    """Processor time [s] of this process that went into compiling kernels."""

    def __init__(self) -> None:
        self.total_s = 0.0
        self.began_s = 0.0
        self.depth = 0

    def on_start(self, event: Event) -> None:
        if self.depth == 0:
            self.began_s = time.process_time()
        self.depth += 1

    def on_end(self, event: Event) -> None:
        self.depth -= 1
        if self.depth == 0:
            self.total_s += time.process_time() - self.began_s


COMPILING = CompileTime()
register("numba:compile", COMPILING)


def cpu_s() -> float:
    """Processor time [s] of this process and of the child processes that ended, compiling apart."""
    return sum(os.times()[:4]) - COMPILING.total_s


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item):
    """Fail a test that used more than `MOST_CPU_S` and is marked neither slow nor end_to_end."""
    began = cpu_s()
    result = yield
    used = cpu_s() - began
    marked = any(item.get_closest_marker(name) for name in ("slow", "end_to_end"))
    if used > MOST_CPU_S and not marked and not item.config.getoption("--benchmark-only", False):
        pytest.fail(
            f"{item.nodeid} used {used:.1f} s of processor time, at most {MOST_CPU_S:g} s without the mark `slow`: "
            "make it smaller; a rate over many recordings is a study (tests/studies)",
            pytrace=False,
        )
    return result


SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings next to the checkout; tests that need it skip where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the recordings of ../shared/data are not on this machine")
    return SHARED_DATA


@pytest.fixture(scope="session")
def shared_models() -> Path:
    """The folder of networks next to the checkout; tests that need it skip where it is absent."""
    folder = SHARED_DATA.parent / "models"
    if not folder.is_dir():
        pytest.skip("the networks of ../shared/models are not on this machine")
    return folder


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
    """A folder for --models that holds the package's models of synthetic ground as a user's own."""
    from bevameter.framework.core.classifier.shipped import shipped_model

    folder = tmp_path_factory.mktemp("models")
    for sense in ("vision", "audio"):
        shutil.copyfile(shipped_model(f"{sense}-synthetic").file, folder / f"{sense}.skops")
    return folder
