"""How long `bevameter run` takes on a minute of the demo, and how much memory: seconds a minute of driving."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from bevameter.framework.scenario.write import write_scenario

DRIVEN_S = 60.0
ALLOWED_S = 30.0 * DRIVEN_S / 300.0 + 6.0
"""The demo's five minutes may take 30 s; a process's start, imports and models come once."""
ALLOWED_BYTES = 2**30

_RUN = """
import json, sys
from bevameter.framework.traverse import run_traverse
summary = run_traverse(sys.argv[1], sys.argv[2])
try:  # not ru_maxrss: Linux counts the parent's memory into that of a process it starts
    with open("/proc/self/status") as status:
        peak = next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM"))
except OSError:
    try:
        import resource
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    except ImportError:  # Windows has no such count
        peak = 0
print(json.dumps({"peak": peak, "seconds": summary.seconds, "new": summary.observations_new}))
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return write_scenario("demo", tmp_path_factory.mktemp("drive") / "demo", seed=1, duration_s=DRIVEN_S)


def test_run(benchmark, drive, tmp_path_factory):
    def once():
        database = tmp_path_factory.mktemp("db") / "t.db"
        done = subprocess.run(
            [sys.executable, "-c", _RUN, str(drive), str(database)], capture_output=True, text=True, check=True
        )
        return json.loads(done.stdout)

    result = benchmark.pedantic(once, rounds=2, iterations=1)
    benchmark.extra_info |= {"driven_s": DRIVEN_S, "peak_MiB": result["peak"] / 2**20, "run_s": result["seconds"]}
    assert result["new"] > 0
    assert result["peak"] < ALLOWED_BYTES
    if benchmark.enabled:  # tests in parallel would distort the time
        assert benchmark.stats.stats.min < ALLOWED_S
