"""What fusion with an inertial sensor gains where there is no microphone and the camera is blind for a time.

    python tests/studies/fusion_gain.py [--drives 10] [--write]

Drives `camera-imu` of seeds from 101 on, on which no model was trained and nothing was chosen: the share of the track
that the camera, the inertial sensor and both together name rightly, wrongly and not at all. A drive is one item.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from bevameter.framework.scenario.write import write_scenario
from bevameter.framework.traverse import run_traverse
from measured import write
from scipy.stats import t

FIRST_SEED = 101


def shares(seed: int) -> dict[str, np.ndarray]:
    """Shares of a drive's track that are right, wrong and unknown (3,), by sense."""
    with TemporaryDirectory() as folder:
        drive = write_scenario("camera-imu", Path(folder) / "drive", seed=seed)
        found = run_traverse(drive, Path(folder) / "terrain.db").agreement
    lengths = {each.sense: np.array([each.right_m, each.wrong_m, each.unknown_m]) for each in found}
    return {sense: each / each.sum() for sense, each in lengths.items()}


def main() -> None:
    """Print the mean shares with 95 % intervals of the mean over drives."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=10)
    parser.add_argument("--write", action="store_true", help="write docs/measured/fusion-gain.json")
    asked = parser.parse_args()
    rows, drives = [], [shares(seed) for seed in range(FIRST_SEED, FIRST_SEED + asked.drives)]
    for sense in drives[0]:
        each = np.stack([drive[sense] for drive in drives])
        half = t.ppf(0.975, len(each) - 1) * each.std(axis=0, ddof=1) / np.sqrt(len(each))
        parts = zip(("right", "wrong", "unknown"), each.mean(axis=0), half, each.min(axis=0), strict=True)
        text = ", ".join(f"{name} {mean:.3f} +- {width:.3f} (least {low:.3f})" for name, mean, width, low in parts)
        print(f"{sense}, {len(each)} drives: {text}")
        rows.append(
            (
                sense,
                *(
                    f"{mean:.3f} ({mean - width:.3f} to {mean + width:.3f})"
                    for mean, width in zip(each.mean(axis=0), half, strict=True)
                ),
            )
        )
    if asked.write:
        data = (
            f"Simulated; {asked.drives} drives, seeds {FIRST_SEED} to {FIRST_SEED + asked.drives - 1}, shares of the "
            "track (95 % of the mean)"
        )
        write("fusion-gain", ("sense", "right", "wrong", "unknown"), rows, data=data)


if __name__ == "__main__":
    main()
