"""What a whole drive tells that its best single class of ground does not, look-alike by look-alike.

    python tests/studies/whole_against_single_class.py --cache CACHE --out answers.jsonl --processes 2

Simulated drives over three classes of ground and more hide one of the causes that look alike on a bench, everywhere.
Each is explained whole, and on each of its classes alone: the labels then name no other ground, and rows that nobody
labelled are left out. Of the classes the table counts the one that gives the true cause most probability, which nobody
could choose without the truth: the comparison favours the single class.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from concealed.vehicle.conceal import conceal_drive
from judging.answers import answer_of

LOOK_ALIKES = ("load_gain", "exit_angle", "stress_peak_shift", "sinkage_offset")
"""Causes that one soil hardly separates."""

FIRST_SEED = 930000
"""Seeds from here on belong to this study."""

LEAST_CLASSES = 3
"""Fewest classes of ground of a drive."""

ASSERTED = 0.8
"""Probability from which on an effect is asserted."""


def make(cache: Path, effect: str, count: int) -> Iterator[Path]:
    """Write the first drives of an effect that reach 250 nats on enough classes; give their folders."""
    seed = FIRST_SEED + 1000 * LOOK_ALIKES.index(effect)
    while count:
        folder, truth = cache / f"{effect}-{seed}", cache / "truth" / f"{effect}-{seed}.json"
        if not truth.is_file():
            shutil.rmtree(folder, ignore_errors=True)  # left by an interrupted run
            conceal_drive(seed, (effect,), level="hidden").write(folder, truth.parent)
        said = json.loads(truth.read_text(encoding="utf-8"))
        if said["reached"] and len({ground["class"] for ground in said["grounds"]}) >= LEAST_CLASSES:
            count -= 1
            yield folder
        seed += 1


def cut(folder: Path) -> list[Path]:
    """Write the drive once more for each of its classes, nothing else labelled; give the folders."""
    with (folder / "labels.csv").open(encoding="utf-8", newline="") as file:
        labels = list(csv.DictReader(file))
    folders = []
    for name in dict.fromkeys(row["class"] for row in labels):
        alone = folder.parent / "alone" / f"{folder.name}-{name}"
        shutil.copytree(folder, alone, dirs_exist_ok=True)
        with (alone / "labels.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, labels[0])
            writer.writeheader()
            writer.writerows(row for row in labels if row["class"] == name)
        folders.append(alone)
    return folders


def explained(folder: Path) -> dict[str, float]:
    """Give the probability of each effect of the answer; none where there is no answer."""
    try:
        answer = answer_of(folder)
    except Exception as error:
        print(f"{folder}: {error}")
        return {}
    return {each["effect"]: each["probability"] for each in answer["missing"]}


def study(folder: Path) -> dict[str, Any]:
    """Explain a drive whole, and each of its classes alone."""
    effect = folder.name.rsplit("-", 1)[0]
    alone = [explained(each) for each in cut(folder)]
    best = max(alone, key=lambda found: found.get(effect, 0.0))
    return {"name": folder.name, "effect": effect, "whole": explained(folder), "best": best, "alone": alone}


def line(name: str, rows: list[dict[str, Any]], which: str) -> str:
    """Count in how many drives the cause is asserted, another one is, and neither; and the mean of its probability."""
    right = wrong = 0
    for row in rows:
        asserted = {slug for slug, probability in row[which].items() if probability >= ASSERTED} - {"unknown"}
        right += asserted == {row["effect"]}
        wrong += bool(asserted - {row["effect"]})
    mean = sum(row[which].get(row["effect"], 0.0) for row in rows) / len(rows)
    return f"{name:20}  {which:6}  {len(rows):3}  {right:8}  {wrong:7}  {mean:.2f}"


def main() -> None:
    """Make what is missing, explain it, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True, help="JSON lines, added to")
    parser.add_argument("--count", type=int, default=8, help="drives of each cause")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    rows = [json.loads(text) for text in given.out.read_text().splitlines()] if given.out.is_file() else []
    done = {row["name"] for row in rows}
    folders = [folder for effect in LOOK_ALIKES for folder in make(given.cache, effect, given.count)]
    with ProcessPoolExecutor(given.processes) as pool, given.out.open("a", encoding="utf-8") as file:
        for row in pool.map(study, [folder for folder in folders if folder.name not in done]):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
    print("hidden                what      n  asserted  another  mean P")
    for effect in LOOK_ALIKES:
        own = [row for row in rows if row["effect"] == effect]
        for which in ("whole", "best") if own else ():
            print(line(effect, own, which))


if __name__ == "__main__":
    main()
