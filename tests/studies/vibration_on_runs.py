"""Vibration on runs that were held out: single windows, all windows that begin within five or ten seconds, whole runs.

    python tests/studies/vibration_on_runs.py FOLDER [--folds 48] [--seed 0] [--worse] [--write]

FOLDER is labelled, ../shared/data/vehicle-vibration for one.

With `--worse` single windows of the same runs are answered as worse sensors would have recorded them (simulated).
Runs are held out whole, in as many folds as there are runs by default. Balanced accuracy has a 95 % interval of whole
runs; an answer of "unknown" counts as wrong. Windows are joined as `TerrainClassifier.pool` joins near copies, by the
correlation within runs that the training side shows.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from dataclasses import replace

import numpy as np
from bevameter.audio.vibration import vibration_evidence
from bevameter.audio.vibration_train import train_vibration
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.classifier.scores import accuracy_intervals, confusion_by_unit
from bevameter.framework.core.recording.vibration import read_vibration_run
from measured import write
from sklearn.model_selection import KFold

STRETCHES_S = {"5 s": 5.12, "10 s": 10.24, "whole run": np.inf}


def noisy(ratio_dB):
    """White noise in every channel, so far below its vibration over the run."""
    return lambda moved, time_s, rng: moved + moved.std(axis=0) * 10 ** (-ratio_dB / 20) * rng.normal(size=moved.shape)


def toned(ratio_dB, pitch_Hz=17.0):
    """A tone in every channel, at a phase of its own."""

    def change(moved, time_s, rng):
        phase = 2 * np.pi * pitch_Hz * time_s[:, None] + rng.uniform(0, 2 * np.pi, moved.shape[1])
        return moved + moved.std(axis=0) * 10 ** (-ratio_dB / 20) * np.sqrt(2) * np.sin(phase)

    return change


def slow(rate_Hz):
    """Fewer samples a second, joined by straight lines."""

    def change(moved, time_s, rng):
        times = np.arange(time_s[0], time_s[-1] + 1 / rate_Hz, 1 / rate_Hz)
        return np.column_stack([np.interp(time_s, times, np.interp(times, time_s, each)) for each in moved.T])

    return change


def clipped(share):
    """This share of the samples is beyond the sensor's range."""

    def change(moved, time_s, rng):
        most = np.quantile(np.abs(moved), 1 - share, axis=0)
        return np.clip(moved, -most, most)

    return change


SENSORS = {
    "as it was": lambda moved, time_s, rng: moved,
    "white noise 10 dB below the vibration": noisy(10), "white noise as strong": noisy(0),
    "a tone of 17 Hz 10 dB below": toned(10), "a tone as strong": toned(0),
    "50 samples a second": slow(50), "25 samples a second": slow(25), "5 % of the samples clipped": clipped(0.05),
}  # fmt: skip


def changed(run, sensor, rng):
    """Give a run as another sensor would have recorded it."""
    level = np.nanmean(run.channels, axis=0)
    moved = SENSORS[sensor](np.nan_to_num(run.channels - level), run.time_s, rng)
    return replace(run, channels=level + moved + 0.0 * run.channels)  # gaps stay gaps


def main():
    """Train, answer, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--folds", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worse", action="store_true", help="answers to windows of worse sensors (simulated)")
    parser.add_argument("--write", action="store_true", help="write docs/measured/vibration-runs.json or -worse.json")
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
            if asked.worse:
                rng = np.random.default_rng(asked.seed)
                for sensor in SENSORS:
                    _, _, part = vibration_evidence(changed(run, sensor, rng), model)
                    stated = part.probabilities.max(axis=1)
                    answers[sensor] += [
                        (item.class_name, item.group, *said) for said in zip(part.labels(), stated, strict=True)
                    ]
                continue
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
        if asked.worse:
            known = said < len(names) - 1
            stated = np.mean([row[3] for row in rows], where=known)
            right = np.mean(said == truth, where=known)
            cells[-1] = (length, said_so, f"{1 - known.mean():.2f}", f"{stated:.2f}", f"{right:.2f}")
            print("   ", *cells[-1])
    if asked.write and asked.worse:
        data = f"Real runs, sensors simulated; {len(groups)} runs of one vehicle, {asked.folds or len(groups)} folds"
        columns = ("sensor", "balanced accuracy (95 %)", "unknown", "stated", "right, of those not unknown")
        write("vibration-worse", columns, cells, data=f"{data}, seed {asked.seed}, n = {len(rows)} windows")
    elif asked.write:
        held = "each left out in turn" if asked.folds is None else f"{asked.folds} folds of runs"
        data = f"Real; {len(groups)} runs of one vehicle on {len(names) - 1} grounds, {held}, seed {asked.seed}"
        write("vibration-runs", ("answers of", "n", "balanced accuracy (95 %)"), cells, data=data)


if __name__ == "__main__":
    main()
