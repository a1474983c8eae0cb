"""What learnt trust is worth: cells of whole synthetic drives, fused with learnt weights and with the raw quality.

    python tests/studies/trust_in_fusion.py [--seeds 2] [--models FOLDER]

Drives are of seeds that no model was trained on. Cells that lie across a boundary of classes are left out. Printed are
log loss, calibration error, and the error at full coverage and among the 80 % of cells of the highest probability.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from bevameter.framework.core.classifier.calibration import log_loss
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.scores import calibration_error, selective_error
from bevameter.framework.core.classifier.shipped import load_model
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.track.way import track_of
from bevameter.framework.fusion import fuse
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.seeing import ground_sites
from bevameter.framework.scenario.write import write_scenario
from bevameter.framework.sense_map import observe
from drive_scores import stretch_of
from perception_on_drives import FIRST_SEED, NAMES

CELL_M = 0.5
SENSES = (("vision",), ("audio",), ("vision", "audio"))


def beliefs(name: str, seed: int, models: Mapping[str, Mapping[str, TerrainClassifier]]) -> dict:
    """Probabilities (n, k) and truths (n,) of cells of a drive, by what the weights are and the senses."""
    found = {}
    plan = make_plan(PRESETS[name], seed)
    with TemporaryDirectory() as folder:
        write_scenario(name, Path(folder) / "drive", seed=seed)
        recording = read_recording(Path(folder) / "drive")
        for weights, by_sense in models.items():
            maps = {record.name: record.map for record in observe(recording, track_of(recording), by_sense, CELL_M)}
            for senses in SENSES:
                belief = fuse([maps[sense] for sense in senses])
                truth, whole = ground(plan, belief.cells)
                rows = np.flatnonzero(whole & ~belief.unknown)
                index = np.searchsorted(belief.classes, truth[rows])
                found[weights, senses] = belief.probabilities[rows], index
    return found


def ground(plan, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Class of the ground at cells (n, 2), and whether a cell lies in one stretch as a whole."""
    sites = ground_sites(plan, tile_px=64)
    x, y = ((cells + 0.5) * CELL_M).T
    owner = stretch_of(sites, x, y)
    reach, whole = 0.4 * CELL_M, np.ones(len(cells), dtype=bool)
    for dx, dy in ((reach, reach), (reach, -reach), (-reach, reach), (-reach, -reach)):
        whole &= stretch_of(sites, x + dx, y + dy) == owner
    return np.array([stretch.terrain for stretch in plan.stretches])[owner], whole


def main() -> None:
    """Print one line for each kind of weights and set of senses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="drives of each scenario")
    parser.add_argument("--models", type=Path, help="folder with vision.skops and audio.skops; else those that ship")
    asked = parser.parse_args()
    learnt = {
        sense: load_model(asked.models / f"{sense}.skops" if asked.models else f"{sense}-synthetic", sense)
        for sense in ("vision", "audio")
    }
    raw = {sense: replace(model, fitted=replace(model.fitted, trust=None)) for sense, model in learnt.items()}
    drives = [
        beliefs(name, seed, {"raw quality": raw, "learnt trust": learnt})
        for name in NAMES
        for seed in range(FIRST_SEED, FIRST_SEED + asked.seeds)
    ]
    for senses in SENSES:
        for weights in ("raw quality", "learnt trust"):
            p, y = (np.concatenate([drive[weights, senses][part] for drive in drives]) for part in (0, 1))
            even = np.ones(len(y))
            full, most = (selective_error(p, y, even, share) for share in (1.0, 0.8))
            print(
                f"{' and '.join(senses):16s} {weights:13s} {len(drives)} drives, n = {len(y)}: log loss "
                f"{log_loss(p, y, even):.4f} nat, calibration error {calibration_error(p, y, even)[0]:.4f}, "
                f"error {full:.4f}, at 80 % coverage {most:.4f}"
            )


if __name__ == "__main__":
    main()
