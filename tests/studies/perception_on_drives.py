"""What the package's models of synthetic ground state on whole drives: accuracy and calibration.

Seeds 1 and 2 of `demo`, `short` and `rover4`, and 0 to 3 of `camera-imu`, were used in development; seeds from 101 on
were not. Scores are those of `drive_scores`, pooled by the rows that are known.

    python tests/studies/perception_on_drives.py --seeds 2
"""

from __future__ import annotations

import argparse

import numpy as np
from bevameter.framework.core.classifier.shipped import shipped_model
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS
from drive_scores import judge_camera, judge_microphone, judge_vibration

FIRST_SEED = 101
NAMES = ("demo", "short", "rover4")
FELT = "camera-imu"
"""The drive with an inertial sensor."""


def in_line(score: dict[str, float]) -> str:
    """Scores as one line."""
    return ", ".join(f"{key} {value:.3f}" for key, value in score.items())


def main() -> None:
    """Print the scores of every drive, of rows with engine noise, and of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="drives of each scenario")
    arguments = parser.parse_args()
    judges = {
        "camera": (judge_camera, shipped_model("vision-synthetic").load()),
        "microphone": (judge_microphone, shipped_model("audio-synthetic").load()),
        "vibration sensor": (judge_vibration, shipped_model("vibration-synthetic").load()),
    }
    scores: dict[str, list[dict[str, float]]] = {sense: [] for sense in judges}
    for name in (*NAMES, FELT):
        for seed in range(FIRST_SEED, FIRST_SEED + arguments.seeds):
            plan = make_plan(PRESETS[name], seed)
            there = ("camera", "vibration sensor") if name == FELT else ("camera", "microphone")
            for sense, (judge, model) in ((sense, judges[sense]) for sense in there):
                judged = judge(plan, model)
                scores[sense].append(judged.scores())
                print(f"{name} {seed} {sense}: {in_line(scores[sense][-1])}", flush=True)
                if sense == "microphone" and (judged.fault == "engine").any():
                    print(f"    engine: {in_line(judged.scores(judged.fault == 'engine'))}")
    for sense, rows in scores.items():
        weight = [row["n"] * row["known"] for row in rows]
        print(
            f"{sense}, all: {in_line({key: np.average([row[key] for row in rows], weights=weight) for key in rows[0]})}"
        )


if __name__ == "__main__":
    main()
