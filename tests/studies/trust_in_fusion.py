"""What learnt trust is worth: cells of whole synthetic drives, fused with learnt weights and with the raw quality.

    python tests/studies/trust_in_fusion.py [--seeds 2] [--models FOLDER] [--items] [--data ../shared/data]
        [--write]

Drives are of seeds that no model was trained on. Cells that lie across a boundary of classes are left out. Printed are
log loss, calibration error, and the error at full coverage and among the 80 % of cells of the highest probability.
`--items` trains what ships and compares weights of single items instead: by the score, 1, in proportion to the accuracy
above chance at that score, and learnt; fitted to four fifths of the groups and tried on the others.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from bevameter.framework.core.classifier.calibration import log_loss
from bevameter.framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from bevameter.framework.core.classifier.fitting import row_weights
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.classifier.scores import calibration_error, selective_error
from bevameter.framework.core.classifier.shipped import load_model
from bevameter.framework.core.classifier.trust import learn_trust
from bevameter.framework.core.pooling import pooled
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.track.way import track_of
from bevameter.framework.fusion import fuse
from bevameter.framework.observing import observe
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.seeing import ground_sites
from bevameter.framework.scenario.write import write_scenario
from bevameter.framework.senses import sense_named
from drive_scores import stretch_of
from measured import write
from perception_on_drives import FIRST_SEED, NAMES
from shipped_models import FREE, REAL_SEED, ROOT, train_synthetic
from sklearn.isotonic import IsotonicRegression
from sklearn.model_selection import StratifiedGroupKFold

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


def compared(name: str, outcome: TrainingOutcome) -> tuple[str, ...]:
    """Print the log loss and calibration error of items held out, weighed in several ways; give the log losses."""
    material, k = outcome.material, len(outcome.classifier.classes)
    rows = np.flatnonzero(material.held.scored & (material.quality > 0))
    p, score = material.held.probabilities[rows], material.quality[rows]
    y, group = material.rows.y[rows], material.rows.group[rows]
    weight = row_weights(y, group)
    accurate, learnt = np.zeros(len(y)), np.zeros(len(y))
    for train, test in StratifiedGroupKFold(5, shuffle=True, random_state=1).split(p, y, group):
        right = IsotonicRegression(out_of_bounds="clip").fit(
            score[train], p[train].argmax(axis=1) == y[train], sample_weight=weight[train]
        )
        above = right.predict(np.append(score[test], 1.0)) - 1 / k
        accurate[test] = np.clip(above[:-1] / max(above[-1], 1e-9), 0.01, 1.0)
        own = row_weights(y[train], group[train])
        trust, _ = learn_trust(p[train], y[train], group[train], score[train], own)
        learnt[test] = trust.at(score[test])
    ways = {"score": score, "1": np.ones(len(y)), "accuracy": accurate, "learnt": learnt}
    losses = []
    for way, exponent in ways.items():
        weighed = pooled(np.log(p) * exponent[:, None])
        error = calibration_error(weighed, y, weight)[0]
        losses.append(log_loss(weighed, y, weight))
        print(f"{name:16s} n = {len(y)}, {way:9s} log loss {losses[-1]:.4f}, calibration {error:.3f}")
    return name, str(len(y)), *(f"{each:.3f}" for each in losses)


def compare_items(data: Path) -> list[tuple[str, ...]]:
    """Train what ships, and compare weights of its items."""
    rows = []
    photographs = [i for i in read_labelled(data / "ground-photos") if i.extra["licence"] in FREE]
    for sense, items in (("vision", photographs), ("audio", read_labelled(data / "contact-sound" / "nox"))):
        rows.append(compared(f"{sense}-real", sense_named(sense).train(items, np.random.default_rng(REAL_SEED))))
        rows.append(compared(f"{sense}-synthetic", train_synthetic(sense)))
    return rows


def main() -> None:
    """Print one line for each kind of weights and set of senses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2, help="drives of each scenario")
    parser.add_argument("--models", type=Path, help="folder with vision.skops and audio.skops; else those that ship")
    parser.add_argument("--items", action="store_true", help="compare weights of single items")
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--write", action="store_true", help="write trust-drives or trust-items of docs/measured")
    asked = parser.parse_args()
    if asked.items:
        rows = compare_items(asked.data)
        if asked.write:
            columns = (
                "items",
                "n",
                "score",
                "1 for all",
                "in proportion to accuracy above chance",
                "likeliest exponent",
            )
            data = "Real and simulated; log loss [nat] of single items, tried on a fifth of the groups"
            write("trust-items", columns, rows, data=data)
        return
    rows = []
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
            loss, error = log_loss(p, y, even), calibration_error(p, y, even)[0]
            rows.append(
                (
                    " and ".join(senses),
                    str(len(y)),
                    weights,
                    f"{loss:.3f}",
                    f"{error:.3f}",
                    f"{full:.4f}",
                    f"{most:.4f}",
                )
            )
            print(
                f"{' and '.join(senses):16s} {weights:13s} {len(drives)} drives, n = {len(y)}: log loss "
                f"{loss:.4f} nat, calibration error {error:.4f}, "
                f"error {full:.4f}, at 80 % coverage {most:.4f}"
            )
    if asked.write:
        columns = (
            "senses", "n", "weight", "log loss [nat]", "calibration error", "error", "error among the surest 80 %",
        )  # fmt: skip
        write("trust-drives", columns, rows, data=f"Simulated; cells of {len(drives)} drives")


if __name__ == "__main__":
    main()
