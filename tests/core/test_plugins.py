"""Entry points of other distributions: one that cannot be imported is left out, whatever it raises."""

from __future__ import annotations

import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from bevameter.framework.core.plugins import load_plugins, once


@pytest.mark.parametrize(
    ("module", "said"),
    [
        ("no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("raising_plugin", "ZeroDivisionError: division by zero"),
        ("good_plugin:absent", "AttributeError: .*absent"),
    ],
)
def test_the_warning_names_entry_point_distribution_and_error(module, said, tmp_path, monkeypatch):
    (tmp_path / "raising_plugin.py").write_text("1 / 0\n")
    (tmp_path / "good_plugin.py").write_text("")
    info = tmp_path / "their_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[bevameter.tests]\nbroken = {module}\ngood = good_plugin\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(UserWarning, match="left out") as caught:
        load_plugins("bevameter.tests")
    (warning,) = caught
    expected = rf"entry point broken = {module} of their-package \(bevameter\.tests\) is left out: {said}"
    assert re.match(expected, str(warning.message))
    assert "good_plugin" in sys.modules
    monkeypatch.delitem(sys.modules, "good_plugin")


def test_threads_find_a_registry_filled_whichever_comes_first():
    registry = []

    @once
    def load():
        if not registry:
            time.sleep(0.05)
            registry.extend("ab")

    def use(_):
        load()
        return tuple(registry)

    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(use, range(4))) == {("a", "b")}
