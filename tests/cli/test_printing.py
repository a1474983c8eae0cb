"""Progress of long work: a line now and then where there is no terminal, nothing where none is wanted."""

import time

import pytest
from bevameter.framework.cli import printing


@pytest.fixture
def often(monkeypatch):
    monkeypatch.setattr(printing._Progress, "every_s", 0.05)
    monkeypatch.setattr(printing._Progress, "quiet", False)


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
