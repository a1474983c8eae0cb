"""The sets of recordings that `explain` is judged on, and the cache that holds them.

A cache holds `recordings/<name>/`, the folders that `explain` reads, and `truth/<name>.json`, what they hide. The
truth is written last: where it exists, the recording is complete.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FROZEN_SEEDS = range(880000, 880340)
"""Of the study; about 30 % of them hide nothing."""

FROZEN_GENERATOR_SEEDS = range(5000, 5120)
"""Of the frozen generator, written independently."""

TRAINING_SEEDS = range(900000, 900160)
"""Of the study, for whoever works on `explain`; all other seeds of the study but the frozen ones are free, too."""

DRIVE_SEEDS, FROZEN_DRIVE_SEEDS = range(910000, 910060), range(890000, 890120)
"""Of whole drives over several grounds, for whoever works on `explain`, and frozen."""

STUDIES = {"study": "concealed.study", "drives": "concealed.vehicle.study"}
"""Modules that make recording number s, by the name of the generator."""


@dataclass(frozen=True)
class RecordingSet:
    """Recordings by seed.

    Parameters
    ----------
    generator
        ``"study"``, ``"drives"`` or ``"frozen_generator"``.
    seeds
        One recording each.
    protocol
        Protocol of all recordings of the study that can show their effects in it; drawn for each where absent.
    """

    generator: str
    seeds: range
    protocol: str | None = None

    @property
    def frozen(self) -> bool:
        """Whether those who work on `explain` may see aggregates only."""
        frozen = {"study": FROZEN_SEEDS, "drives": FROZEN_DRIVE_SEEDS}
        return self.generator not in frozen or bool({*self.seeds} & {*frozen[self.generator]})

    def named(self) -> dict[str, int]:
        """Give the seeds by the recordings' names."""
        kind = [self.generator] if self.protocol is None else [self.generator, self.protocol]
        return {"-".join([*kind, str(seed)]): seed for seed in self.seeds}


SETS = {
    "training": RecordingSet("study", TRAINING_SEEDS),
    "frozen": RecordingSet("study", FROZEN_SEEDS),
    "frozen-generator": RecordingSet("frozen_generator", FROZEN_GENERATOR_SEEDS),
    "drives": RecordingSet("drives", DRIVE_SEEDS),
    "frozen-drives": RecordingSet("drives", FROZEN_DRIVE_SEEDS),
}


def folder_of(cache: Path, name: str) -> Path:
    return cache / "recordings" / name


def truth_path(cache: Path, name: str) -> Path:
    return cache / "truth" / f"{name}.json"


def stored_truths(cache: Path, recordings: RecordingSet) -> dict[str, dict[str, Any]]:
    """Read the truths of the recordings that the cache holds, by name."""
    paths = {name: truth_path(cache, name) for name in recordings.named()}
    return {name: json.loads(path.read_text(encoding="utf-8")) for name, path in paths.items() if path.is_file()}


def make(cache: Path, recordings: RecordingSet, processes: int) -> Iterator[tuple[str, str | None]]:
    """Make the recordings that the cache lacks; give each name as it is done, with the error where there was one."""
    missing = {name: seed for name, seed in recordings.named().items() if not truth_path(cache, name).is_file()}
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        jobs = {pool.submit(make_one, cache, recordings, name, seed): name for name, seed in missing.items()}
        for job in as_completed(jobs):
            error = job.exception()
            yield jobs[job], None if error is None else f"{type(error).__name__}: {error}"


def make_one(cache: Path, recordings: RecordingSet, name: str, seed: int) -> None:
    folder, path = folder_of(cache, name), truth_path(cache, name)
    for parent in (folder.parent, path.parent):
        parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder, ignore_errors=True)  # left by an interrupted run
    with tempfile.TemporaryDirectory(dir=cache) as place:
        truth = Path(place) / "truth"
        if recordings.generator in STUDIES:
            study = importlib.import_module(STUDIES[recordings.generator])
            protocol = {} if recordings.protocol is None else {"protocol": recordings.protocol}
            study.make(seed, **protocol).write(folder, truth)
        else:
            importlib.import_module("frozen_generator.generate").write(seed, folder, truth)
        _only(list(truth.glob("*.json")), truth).replace(path)


def _only(files: Sequence[Path], folder: Path) -> Path:
    if len(files) != 1:
        raise ValueError(f"{folder}: {len(files)} files of truth, expected one")
    return files[0]
