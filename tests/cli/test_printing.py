"""What is printed: progress of long work, nothing of it where none is wanted; classes without soil in one line."""

import os
import re
import subprocess
import sys
import time

import pytest
from bevameter.framework.cli import printing
from bevameter.framework.cli.results import print_classes
from bevameter.framework.core.errors import InputError


@pytest.fixture
def often(monkeypatch):
    monkeypatch.setattr(printing._Progress, "every_s", 0.05)
    monkeypatch.setattr(printing._Progress, "quiet", False)
    monkeypatch.setattr(printing._Progress, "verbose", False)


def test_work_of_which_nothing_is_reported(often, capsys):
    with printing.status("identifying"):
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert lines
    assert all(line == "identifying (0 s)" for line in lines)


def test_work_that_reports_what_it_does(often, capsys):
    with printing.progress_bars() as report:
        report("reading", 0.25)
        time.sleep(0.15)
        report("identifying", 0.5)
        time.sleep(0.15)
    lines = capsys.readouterr().err.splitlines()
    assert "reading 25% (0 s)" in lines
    assert lines[-1] == "identifying 50% (0 s)"


def test_nothing_is_shown_of_short_work_or_where_it_is_not_wanted(often, capsys):
    printing.show_progress(quiet=True)
    for shown in (printing.status("identifying"), printing.progress_bars()):
        with shown:
            time.sleep(0.12)
    printing.show_progress(quiet=False)
    with printing.status("a moment"):
        pass
    assert capsys.readouterr().err == ""


def test_each_stage_is_printed_with_its_time_where_that_is_wanted(often, capsys):
    printing.show_progress(verbose=True)
    with printing.status("explaining drive") as now:
        now("reading")
        time.sleep(0.12)
        now("fitting")
    with printing.progress_bars() as report:
        for share in (0.0, 0.5, 1.0):
            report("camera", share)
        report("soil", 0.3)
    lines = capsys.readouterr().err.splitlines()
    assert [re.sub(r"[\d.]+ s", "# s", line) for line in lines] == [
        "explaining drive: reading: # s", "explaining drive: fitting: # s", "explaining drive: # s in all",
        "camera: # s", "soil: # s", "# s in all",
    ]  # fmt: skip
    assert lines[0].endswith("reading: 0.1 s")


def test_much_and_nothing_is_refused():
    with pytest.raises(InputError, match="--verbose: and --quiet, too"):
        printing.show_progress(quiet=True, verbose=True)


@pytest.mark.parametrize("without", [False, True])
def test_no_color_is_respected(without):
    code = "from bevameter.framework.cli.printing import print_line; print_line('[yellow]warned[/yellow]')"
    coloured = {name: value for name, value in os.environ.items() if name != "NO_COLOR"} | {
        "FORCE_COLOR": "1", "TERM": "xterm-256color",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True,
        env=coloured | ({"NO_COLOR": "1"} if without else {}),
    )  # fmt: skip
    assert ("\x1b[33m" in done.stdout) is not without
    assert "warned" in done.stdout


def test_classes_without_soil_are_named_in_one_line(capsys):
    row = {"known": False, "cells": 0, "observations": 0}
    rows = [{**row, "class": name, "unknown": f"no soil data for class {name}"} for name in ("clay", "grass")]
    print_classes(rows, 20e3, 0.95)
    assert capsys.readouterr().out.splitlines()[-1] == "unknown: no soil data for class clay, grass"


def test_classes_that_no_drive_has_seen_are_named_below_the_others(capsys):
    row = {"known": False, "observations": 0}
    rows = [{**row, "class": name, "cells": cells, "unknown": name} for name, cells in (("clay", 0), ("grass", 3))]
    print_classes(rows, 20e3, 0.95)
    printed = capsys.readouterr().out.splitlines()
    assert printed[-2:] == ["unknown: grass", "not seen yet: clay"]
    assert [line.split()[0] for line in printed[1:-2]] == ["grass"]
