"""Tables of measurements: each is shown on one page, says when and where it was made, and is what the README quotes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from measured import FOLDER, NOT_RECORDED, Measured, read, write

ROOT = Path(__file__).resolve().parents[2]
NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))
PAGES = [path for path in (ROOT / "docs").rglob("*.md") if not any(part.startswith("_") for part in path.parts)]
README = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
OVER = "time over the truth's, routes"


def test_each_table_is_shown_on_one_page():
    shown = [name for page in PAGES for name in re.findall(r"^```\{measured\} (\S+)", page.read_text(), re.MULTILINE)]
    assert sorted(shown) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_table_says_when_it_was_made(name):
    table = read(name)
    assert re.match(r"\d{4}-\d\d-\d\d", table.date)
    assert table.markdown().count("\n| ") == len(table.rows) + 1


def test_what_is_written_now_says_where_and_is_read_back(tmp_path, monkeypatch):
    monkeypatch.setattr("measured.FOLDER", tmp_path)
    write("t", ("a", "b [m]"), [("x", "1.0")], data="Simulated", command="make t")
    table = read("t")
    assert table.cell("x", "b [m]") == "1.0"
    assert "cores of" in table.machine
    assert table.commit != NOT_RECORDED
    with pytest.raises(ValueError, match="when and where"):
        Measured("Simulated", "make t", "", "c", "m", ("a",), (("x",),))


def counts(cell: str) -> tuple[int, int]:
    right, of = re.match(r"(\d+) of (\d+)", cell).groups()
    return int(right), int(of)


def summed(name: str, column: str, rows: tuple[str, ...]) -> str:
    table = read(name)
    return "{} of {}".format(*map(sum, zip(*(counts(table.cell(row, column)) for row in rows), strict=True)))


def test_the_readme_quotes_what_was_measured():
    named = ("named right, plain", "named right, hidden")
    c, phi = read("identification-accuracy").rows[0][5].split(" / ")[:2]
    study, other, drives = "frozen seeds of the study, 340", "frozen generator, 120", "120 frozen drives"
    routes, bounds = read("closed-loop-routes"), read("closed-loop-bounds")
    nulls = "false alarms on nulls"
    quoted = [
        f"{c} % (c) and {phi} % (phi) of 200 drives",
        f"{summed('explain-benches', study, named)} single effects",
        f"a false alarm in {summed('explain-benches', study, (nulls,))} nulls",
        f"by another hand: {summed('explain-benches', other, named)}",
        f"a false alarm in {summed('explain-benches', other, (nulls,))}.",
        f"{summed('explain-drives', drives, named)} plain and hidden single effects",
        f"a false alarm in {summed('explain-drives', drives, (nulls,))}",
        f"{routes.cell('database', OVER).split()[0]} times the time",
        f"{routes.cell('database', 'no route').split()[0]} % without a route",
        f"{routes.cell('database', 'left the path').split()[0]} % left the path",
        f"{bounds.cell('database', 'longer than predicted').split()[0]} % of the stops are longer than predicted",
    ]
    fast = "Class, strength and lower bound of places along a path"
    photographs, models = read("photographs"), read("models-shipped")
    own, other_source = (
        photographs.cell((split, "built-in features"), "as it is")
        for split in ("photographs, five folds, n = 170", "the other source, n = 143")
    )
    quoted += [
        f"balanced accuracy {own} per photograph",
        f"{other_source} on photographs of a source not trained on",
        re.match(r"balanced accuracy \S+ \(.*?\)", models.cell("`vision-real`", "measured")).group(),
        f"both together {float(read('fusion-gain').cell('all together', 'right')[:5]):.0%}".replace("%", " %"),
    ]
    for row, quote in (
        (f"{fast} (200)", "200 places {}"),
        (f"{fast} (10000)", "of 10,000 {}"),
        ("Taking a snapshot of 160,000 cells", "Taking a snapshot {}"),
    ):
        quoted.append(quote.format(read("speed").cell(row, "median")))
    assert [each for each in quoted if each not in README] == []


def test_the_planners_page_quotes_what_was_measured():
    routes = read("closed-loop-routes")
    eight, four, two = (
        routes.cell(f"database{learnt}", "arrived").split()[0]
        for learnt in ("", ", 4 stretches a class", ", 2 stretches a class")
    )
    page = (ROOT / "docs" / "howto" / "planner.md").read_text(encoding="utf-8")
    assert f"{eight} % arrived with eight places a class, {four} % with four, {two} % with two" in page
