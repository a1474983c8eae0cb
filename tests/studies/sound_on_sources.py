"""Footsteps of one source by a model of the others: balanced accuracy of clips, on classes that both have.

    python tests/studies/sound_on_sources.py ../shared/data/contact-sound [--candidates kernel,trees] [--seeds 3]
        [--write]

Each folder of the data with an `index.csv` is a source. A clip has the class of the greatest sum of probabilities over
its windows; "unknown" counts as wrong. Seeds vary the copies that the training makes. 95 % intervals are of takes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from bevameter.audio import train
from bevameter.audio.classify import sound_evidence
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.classifier.scores import accuracy_intervals, confusion_by_unit
from bevameter.framework.core.recording.sound import read_sound
from measured import write


def named(model, item) -> str:
    """Class of a clip, "unknown" where most of its windows are."""
    evidence = sound_evidence(*read_sound(item.file), model)[2]
    if 2 * evidence.unknown.sum() > len(evidence.unknown):
        return "unknown"
    return model.classes[np.where(evidence.unknown[:, None], 0.0, evidence.probabilities).sum(axis=0).argmax()]


def main():
    """Train on all sources but one, answer that one, print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--candidates", default=",".join(train.CANDIDATES))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--write", action="store_true", help="write docs/measured/sound-sources.json")
    asked = parser.parse_args()
    train.CANDIDATES = tuple(asked.candidates.split(","))
    sources = {
        index.parent.name: [replace(i, class_name=str(i.extra["common_class"])) for i in read_labelled(index.parent)]
        for index in sorted(asked.folder.glob("*/index.csv"))
    }
    rows = []
    for name, items in sources.items():
        others = [item for other, part in sources.items() if other != name for item in part]
        tested = [item for item in items if item.class_name in {other.class_name for other in others}]
        scores, shown = [], []
        for seed in range(asked.seeds):
            model = train.train_audio(others, np.random.default_rng(seed)).classifier
            names = [*model.classes, "unknown"]
            truth, said = (
                np.array([names.index(each) for each in part])
                for part in ([item.class_name for item in tested], [named(model, item) for item in tested])
            )
            unit = np.unique([item.group for item in tested], return_inverse=True)[1]
            score = accuracy_intervals(confusion_by_unit(truth, said, unit, len(names)))["balanced_accuracy"]
            scores.append(score["value"])
            shown.append(f"{score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f})")
            print(
                f"{name}, n = {len(tested)}, seed {seed}: {shown[-1]}, "
                f"unknown {np.mean(said == len(names) - 1):.2f}, {model.report['model']}"
            )
        print(f"{name}: mean {np.mean(scores):.3f}")
        rows.append((name, str(len(tested)), f"{np.mean(scores):.3f}", shown[0]))
    if asked.write:
        data = f"Real footsteps; balanced accuracy of clips, by a model of the other sources, {asked.seeds} seeds"
        write("sound-sources", ("source held out", "n", "mean over seeds", "at seed 0 (95 %)"), rows, data=data)


if __name__ == "__main__":
    main()
