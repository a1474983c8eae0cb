"""Vibration on runs that were held out: single windows, all windows that begin within five or ten seconds, whole runs.

    python tests/studies/vibration_on_runs.py ../shared/data/vehicle-vibration [--folds 48] [--seed 0] [--write]

Runs are held out whole, in as many folds as there are runs by default. Balanced accuracy has a 95 % interval of whole
runs; an answer of "unknown" counts as wrong. Windows are joined as `TerrainClassifier.pool` joins near copies, by the
correlation within runs that the training side shows.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict

import numpy as np
from bevameter.audio.vibration import train_vibration, vibration_evidence
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.classifier.scores import accuracy_intervals, confusion_by_unit
from bevameter.framework.core.recording.vibration import read_vibration_run
from measured import write
from sklearn.model_selection import KFold

STRETCHES_S = {"5 s": 5.12, "10 s": 10.24, "whole run": np.inf}


def main():
    """Train, answer, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--folds", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help="write docs/measured/vibration-runs.json")
    asked = parser.parse_args()
    items, begun = read_labelled(asked.folder), time.perf_counter()
    groups = np.unique([item.group for item in items])
    answers = defaultdict(list)  # by length: class, run, class that was named
    for _, held in KFold(asked.folds or len(groups), shuffle=True, random_state=asked.seed).split(groups):
        test = [item for item in items if item.group in groups[held]]
        train = [item for item in items if item.group not in groups[held]]
        model = train_vibration(train, np.random.default_rng(asked.seed)).classifier
        for item in test:
            run = read_vibration_run(item.file, item.extra.get("wheel_file") or None)
            start_s, _, evidence = vibration_evidence(run, model)
            parts = {"window": evidence}
            for name, length_s in STRETCHES_S.items():
                parts[name] = model.pool(evidence, (start_s // length_s).astype(int))
            for name, part in parts.items():
                answers[name] += [(item.class_name, item.group, said) for said in part.labels()]
    names = [*sorted({item.class_name for item in items}), "unknown"]
    print(f"{len(groups)} runs, {time.perf_counter() - begun:.0f} s")
    cells = []
    for length, rows in answers.items():
        truth, said = (np.array([names.index(row[at]) for row in rows]) for at in (0, 2))
        unit = np.unique([row[1] for row in rows], return_inverse=True)[1]
        by_unit = confusion_by_unit(truth, said, unit, len(names))
        score = accuracy_intervals(by_unit)["balanced_accuracy"]
        said_so = f"{score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f})"
        cells.append((length, str(len(rows)), said_so))
        table = by_unit.sum(axis=0)
        recall = ", ".join(
            f"{name} {row[i] / row.sum():.2f}" for i, (name, row) in enumerate(zip(names, table[:-1], strict=False))
        )
        print(f"{length:10s} n = {len(rows)}: {said_so}, unknown {np.mean(said == len(names) - 1):.3f}; {recall}")
    if asked.write:
        held = "each left out in turn" if asked.folds is None else f"{asked.folds} folds of runs"
        data = f"Real; {len(groups)} runs of one vehicle on {len(names) - 1} grounds, {held}, seed {asked.seed}"
        write("vibration-runs", ("answers of", "n", "balanced accuracy (95 %)"), cells, data=data)


if __name__ == "__main__":
    main()
