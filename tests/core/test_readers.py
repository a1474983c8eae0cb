"""The registry of readers: a format from outside the package is one class that registers itself."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from bevameter import InputError, Recording, WheelTable, read_recording
from bevameter.framework.core.recording import readers

FORMAT = """
import numpy as np
from bevameter import Recording, WheelTable
from bevameter.framework.core.recording.readers import Reader, register

@register
class TabReader(Reader):
    kinds = "a logger's file (.log)"

    def sniff(self, path):
        return path.suffix == ".log" and path.read_bytes().startswith(b"LOG")

    def read(self, path, *, vehicle, topics):
        time_s, load_N = np.loadtxt(path, skiprows=1, unpack=True)
        wheel = WheelTable({"time_s": time_s, "load_N": load_N}, None, None, path)
        return Recording(path.stem, path, vehicle, None, "", "0", wheel=wheel)
"""


@pytest.fixture
def format_of_its_own(tmp_path, monkeypatch):
    """A module outside of the package, whose import is all that it takes."""
    readers.load_readers()
    before = list(readers.READERS)
    (tmp_path / "logger_format.py").write_text(FORMAT)
    monkeypatch.syspath_prepend(tmp_path)
    yield "logger_format"
    readers.READERS[:] = before
    sys.modules.pop("logger_format", None)


def test_a_format_from_outside_the_package_is_read(format_of_its_own, tmp_path):
    path = tmp_path / "drive.log"
    path.write_text("LOG\n0 80\n1 81\n")
    with pytest.raises(InputError, match=r"a file of kind '\.log' .*a recording's folder"):
        read_recording(path)
    __import__(format_of_its_own)
    recording = read_recording(path)
    assert (recording.name, recording.wheel["load_N"].tolist()) == ("drive", [80.0, 81.0])
    path.write_text("something else")
    with pytest.raises(InputError, match=r"expected .*a logger's file \(\.log\)"):
        read_recording(path)


def test_a_reader_that_was_added_later_comes_first(tmp_path):
    class Own(readers.Reader):
        kinds = "wheel files of our own"

        def sniff(self, path):
            return path.name == "wheel.csv"

        def read(self, path, *, vehicle, topics):
            wheel = WheelTable({"time_s": np.zeros(1), "load_N": np.ones(1)}, None, None, path)
            return Recording("own", path, vehicle, None, "", "0", wheel=wheel)

    (tmp_path / "wheel.csv").write_text("time_s,load_N\n0,80\n1,81\n")
    assert read_recording(tmp_path / "wheel.csv").name == "wheel"
    before = list(readers.READERS)
    try:
        readers.register(Own)
        assert read_recording(tmp_path / "wheel.csv").name == "own"
    finally:
        readers.READERS[:] = before


def test_a_format_of_an_entry_point_is_loaded_and_a_broken_one_is_left_out(format_of_its_own, tmp_path, monkeypatch):
    points = [EntryPoint(name, module, "bevameter.readers")
              for name, module in (("broken", "no_such_module"), ("logger", format_of_its_own))]  # fmt: skip
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: points)
    before = list(readers.READERS)
    readers.load_readers.cache_clear()
    path = tmp_path / "drive.log"
    path.write_text("LOG\n0 80\n1 81\n")
    with pytest.warns(UserWarning, match=r"broken = no_such_module of .* \(bevameter\.readers\) is left out") as caught:
        assert len(read_recording(path).wheel) == 2
    assert len(caught) == 1
    assert len(readers.READERS) == len(before) + 1


def test_topics_are_for_bags(tmp_path):
    (tmp_path / "wheel.csv").write_text("time_s,load_N\n0,80\n1,81\n")
    (tmp_path / "topics.toml").write_text('[wheel]\ntopic = "/wheel"\n')
    with pytest.raises(InputError, match=r"topics\.toml: a topic map, which a bag needs.*\[columns\], for a table"):
        read_recording(tmp_path / "wheel.csv", topics=tmp_path / "topics.toml")
