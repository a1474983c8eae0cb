"""How soon a planner's import and the command line's help are there, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest

ALLOWED_S = 0.3
"""What a user waits for without noticing, the start of Python included."""


@pytest.mark.parametrize(
    "arguments", [["-c", "import bevameter"], ["-m", "bevameter.framework.cli.main", "--help"]], ids=["import", "help"]
)
def test_start(benchmark, arguments):
    """Starting Python with the package."""
    command = [sys.executable, *arguments]
    benchmark.pedantic(lambda: subprocess.run(command, check=True, capture_output=True), rounds=10, warmup_rounds=2)
    if benchmark.enabled:
        assert benchmark.stats.stats.median < ALLOWED_S
