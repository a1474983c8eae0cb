"""Make the models that come with the package, their cards, examples and index: `make models`.

    python tests/studies/shipped_models.py [NAME ...] [--data ../shared/data] [--out framework/core/trained]

Models of real ground are trained on the CC0 part of the data and measured on what they were not trained on: other
sources, ground of other classes, other sounds, other mountings of the sensor. A model is a default where a measurement
on another source or vehicle shows that it does not claim more than it knows (`MOST_OVERCONFIDENT`). Training is
deterministic: on one machine and with one set of libraries the content, and so the version, is the same each time.
The files are not the same byte for byte, as they hold addresses in memory.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import soundfile
from bevameter.audio.classify import sound_evidence
from bevameter.audio.features import RATE_HZ
from bevameter.audio.train import train_audio_windows
from bevameter.audio.vibration import vibration_evidence
from bevameter.audio.vibration_train import train_vibration_runs
from bevameter.framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from bevameter.framework.core.classifier.labelled import LabelledFile, read_labelled
from bevameter.framework.core.recording.camera import read_image
from bevameter.framework.core.recording.types import VibrationRun
from bevameter.framework.core.recording.vibration import read_vibration_run
from bevameter.framework.fusion import fuse
from bevameter.framework.sense_map import SenseMap
from bevameter.framework.senses import sense_named
from bevameter.vision.classify import image_evidence, patch_evidence
from bevameter.vision.measures import measures_of
from bevameter.vision.train import train_vision_patches
from model_cards import Made, Measured, card, classified, scored, write_table
from scipy.signal import iirpeak, lfilter
from sklearn.model_selection import StratifiedGroupKFold
from synthetic_samples import labelled_looks, labelled_runs, labelled_sounds, looks_at

ROOT = Path(__file__).resolve().parents[2]
REAL_SEED, SYNTHETIC_SEED = 0, 20021
SITES_PER_CLASS = 24
TILE_PX = 512
"""Side of a tile that is laid on the ground: 2 m [px]."""
NOISE_IMAGES = 60
MOST_OVERCONFIDENT = 0.1
"""Most by which the mean probability of a default model's answers may exceed the share that is right [-]."""
FREE = ("CC0", "CC0-1.0")
VIBRATION_CLASSES = {"ASPHALT": "asphalt", "FLOORING": "floor", "ICE": "ice", "SANDY_LOAM": "soil", "SNOW": "snow"}
SOUND_CLASSES = {"dirt": "soil"}
"""Names that the senses share, so that their evidence can be fused."""


def trained(sense: str, items: Sequence[LabelledFile], notes: Sequence[str] = ()) -> TerrainClassifier:
    return sense_named(sense).train(items, np.random.default_rng(REAL_SEED), notes=notes).classifier


def stated(file: Path, licence: str) -> None:
    """Stop where the notes of the data do not state the licence on which they are used."""
    if licence not in " ".join(file.read_text().split()):
        raise SystemExit(f"{file} does not say {licence!r}")


def copied(source: Path) -> Callable[[Path], Path]:
    return lambda target: Path(shutil.copyfile(source, target.with_suffix(source.suffix)))


# Real ground ----------------------------------------------------------------------------------------------------------


def vision_real(data: Path) -> Made:
    """Photographs of ground: those that are CC0, by the table of the data."""
    notes: list[str] = []
    labelled = read_labelled(data / "ground-photos", notes)
    items = [item for item in labelled if item.extra["licence"] in FREE]
    left_out = Counter(str(item.extra["licence"]) for item in labelled if item.extra["licence"] not in FREE)
    notes += [f"Left out for their licence, {licence}: {count} photographs." for licence, count in left_out.items()]
    model = trained("vision", items, notes)
    known, strange, seen, fused = [], [], [], []
    rng = np.random.default_rng(REAL_SEED)
    sources = Counter(str(item.extra["source"]) for item in items)
    parts: list[tuple[TerrainClassifier, list[LabelledFile]]] = []
    for source in sources:
        test = [item for item in items if item.extra["source"] == source]
        groups = {item.group for item in test}
        train = [item for item in items if item.extra["source"] != source and item.group not in groups]
        if len({item.class_name for item in train}) > len(model.classes) / 2:  # a photograph or two teach nothing
            parts.append((trained("vision", train), test))
    for other, test in parts:
        for item in test:
            (row,) = sense_named("vision").classify([item.file], other)
            (known if item.class_name in other.classes else strange).append((row, item.class_name, item.group))
        looks, cells = looked_at([item for item in test if item.class_name in other.classes], other, rng)
        seen += looks
        fused += cells
    others, looks, cells, unknown = (
        Measured.of(what, *zip(*rows, strict=True))
        for what, rows in (
            ("photographs of a source not trained on", known),
            ("looks of a moving camera (simulated) at ground paved with these", seen),
            ("the same, all looks at a photograph fused as those at a cell are", fused),
            ("photographs of a source and a class not trained on", strange),
        )
    )
    noise = Measured.of(
        "images of noise alone (simulated)", image_evidence(model, images_of_noise(rng)).as_rows(""),
        ["none"] * NOISE_IMAGES, np.arange(NOISE_IMAGES).astype(str),
    )  # fmt: skip
    commits = {str(item.extra["source"]): str(item.extra["commit"])[:8] for item in items}
    return Made(
        model,
        "\n".join(
            f"- {count} photographs of github.com/{name}, commit {commits[name]}, CC0"
            for name, count in sources.most_common()
        ),
        (others, looks, cells, unknown, noise),
        cells,
        f"balanced accuracy {scored(others.balanced)} on {others.what}, n = {others.n}",
        f"{scored(cells.balanced)} on cells of ground paved with these, seen by a moving camera (simulated), "
        f"n = {cells.n}",
        (
            f"Ground of another class: {unknown.unknown:.0%} of {unknown.n} photographs of such were unknown, the "
            f"others were named as one of these classes with a mean probability of {unknown.said:.2f}.",
            "Images of a robot: all photographs are textures seen from above, most of them of 128 px, some recoloured "
            "by an artist. Perspective, blur and exposure were simulated; shadow, wet or mixed ground were not.",
            "Passability. A class is no statement about what the ground bears.",
        ),
        copied(next(item.file for item in items if item.class_name == "gravel" and item.extra["tier"] == "small")),
        "Features, crops and strengths of variation were chosen on these photographs, so all figures here are somewhat "
        "optimistic. Those of a source not trained on are of models trained on the other sources; this model knows "
        "all.",
    )


def images_of_noise(rng: np.random.Generator) -> list[np.ndarray]:
    """Generate pure-noise images, colour or greyscale, with a standard deviation of 20 to 80 (8-bit scale)."""
    noise = [
        rng.normal(128, rng.uniform(20, 80), (480, 640, 1 + 2 * (number % 2))) * np.ones(3)
        for number in range(NOISE_IMAGES)
    ]
    return [np.clip(image, 0, 255).astype(np.uint8) for image in noise]


def looked_at(
    items: Sequence[LabelledFile], model: TerrainClassifier, rng: np.random.Generator
) -> tuple[list[tuple[dict, str, str]], list[tuple[dict, str, str]]]:
    """Have a camera that drives over ground paved with photographs look at it: answers, classes and groups.

    Those of single looks; and those of photographs, of which all looks are fused as those at a cell are in a run.
    """

    def tile(item: LabelledFile) -> np.ndarray:
        image = read_image(item.file)
        side = min(image.shape[:2])
        how = cv2.INTER_AREA if side > TILE_PX else cv2.INTER_CUBIC
        return np.asarray(cv2.resize(image[:side, :side], (TILE_PX, TILE_PX), interpolation=how))

    looks = looks_at(((item.class_name, item.group, tile(item)) for item in items), rng)
    evidence = patch_evidence(model, measures_of(model), looks.patches)
    groups, first, number = np.unique(looks.groups, return_index=True, return_inverse=True)
    seen = SenseMap("camera")
    seen.add(np.column_stack([number, np.zeros_like(number)]), evidence, np.arange(float(len(number))))
    belief = fuse([seen])
    truths = np.asarray(looks.labels)[first[belief.cells[:, 0]]]
    return (
        list(zip(evidence.as_rows(""), looks.labels, looks.groups, strict=True)),
        list(zip(belief.as_rows(""), truths, groups[belief.cells[:, 0]], strict=True)),
    )


def audio_real(data: Path) -> Made:
    """Footsteps: the source that is CC0; measured on another source, and on what is no footstep."""
    notes: list[str] = []
    folder = data / "contact-sound"
    stated(folder / "NOTES.md", 'NOX SOUND "Essentials Series", CC0')

    def shared(items):
        names = (str(item.extra["common_class"]) for item in items)
        return [replace(item, class_name=SOUND_CLASSES.get(n, n)) for item, n in zip(items, names, strict=True)]

    items = shared(read_labelled(folder / "nox", notes))
    model = trained("audio", items, notes)
    tests = [item for item in shared(read_labelled(folder / "minetest")) if item.class_name in model.classes]
    others = classified("audio", model, tests, "windows of footsteps of a source not trained on")
    noises = [replace(item, class_name="none") for item in noise_files(data / "noise")]
    noise = classified("audio", model, noises, "windows of rain, sea, fire, engines and a clock, no footstep in them")
    wheels = synthetic_wheels(model)
    return Made(
        model,
        f'- {len(items)} footsteps (walking, jumping), NOX SOUND "Essentials Series", CC0, by '
        "github.com/ngoccc0/dreamland-engine. One recordist, one session a ground.",
        (others, wheels, noise),
        wheels,
        f"balanced accuracy {scored(others.balanced)} on {others.what}, n = {others.n}",
        f"trained on footsteps, and of its answers to simulated wheels {wheels.right:.0%} are right, at a mean "
        f"probability of {wheels.said:.2f}",
        (
            "The sound of wheels or tracks: no free recording of a wheel on labelled ground was found, to train on or "
            f"to measure with. On simulated wheels {wheels.right:.0%} of the answers were right.",
            f"Sound without contact: {noise.unknown:.0%} of {noise.n} windows of noise alone were unknown.",
            "Another microphone, shoe or place: each ground was recorded in one session.",
        ),
        copied(next(item.file for item in items if item.class_name == "gravel")),
        "Candidates and noise limits were chosen on how well they carry over to the other source, so its figure is "
        "somewhat optimistic.",
    )


def noise_files(folder: Path, each: int = 8) -> list[LabelledFile]:
    """Give the first clips of each class of noise."""
    seen: Counter[str] = Counter()
    chosen = []
    for line in (folder / "index.csv").read_text().splitlines()[1:]:
        name, kind = line.split(",")[:2]
        seen[kind] += 1
        if seen[kind] <= each:
            chosen.append(LabelledFile(folder / name, kind, name))
    return chosen


def synthetic_wheels(model: TerrainClassifier) -> Measured:
    """Measure answers to simulated wheels at a signal-to-noise ratio of 20 dB and more."""
    sounds = labelled_sounds(np.random.default_rng(SYNTHETIC_SEED + 1), 3)
    clear = np.flatnonzero(sounds.snr_dB >= 20)
    rows = [sound_evidence(sounds.windows[i], RATE_HZ, model)[2].as_rows("")[0] for i in clear]
    truth, groups = np.asarray(sounds.labels)[clear], np.asarray(sounds.groups)[clear]
    return Measured.of("windows of simulated wheels, little noise", rows, truth, groups)


def vibration_real(data: Path) -> Made:
    """One vehicle's inertial sensor and wheel drives; measured on held-out runs as other mountings would show them."""
    notes: list[str] = []
    folder = data / "vehicle-vibration"
    stated(folder / "NOTES.md", "The data are CC0 1.0")
    items = [replace(i, class_name=VIBRATION_CLASSES[i.class_name]) for i in read_labelled(folder, notes)]
    model = trained("vibration", items, notes)
    labels, groups = (np.array([getattr(i, part) for i in items]) for part in ("class_name", "group"))
    rng = np.random.default_rng(REAL_SEED)
    as_it_is, other = [], []
    for train, test in StratifiedGroupKFold(4, shuffle=True, random_state=0).split(labels, labels, groups):
        part = trained("vibration", [items[i] for i in train])
        for i in test:
            alone = read_vibration_run(items[i].file)
            for found, run in ((as_it_is, alone), (other, otherwise_mounted(alone, rng))):
                starts, ends, evidence = vibration_evidence(run, part)
                found += [(row, labels[i], groups[i]) for row in evidence.as_rows("", starts, ends)]
    alone, mounted = (
        Measured.of(what, *zip(*rows, strict=True))
        for what, rows in (
            ("windows of runs not trained on, inertial sensor alone", as_it_is),
            ("the same as another mounting might show them (simulated)", other),
        )
    )
    fastest = f"{max(float(str(item.extra['max_abs_vel'])) for item in items):.2f} m/s"
    groups_score = model.report["by_group"]
    return Made(
        model,
        f"- {len(items)} runs of a Clearpath Husky A200 (inertial sensor, wheel current and speed; up to {fastest}), "
        "BorealTC, github.com/norlab-ulaval/BorealTC commit fe64e386, CC0 1.0",
        (alone, mounted),
        None,
        f"balanced accuracy {scored(groups_score['balanced_accuracy'])} on runs of the same vehicle not trained on, "
        f"n = {groups_score['n']}",
        f"trained on one vehicle at up to {fastest}, and never tried on another",
        (
            "Another vehicle, load, tyre, speed or sensor: no recording of one was at hand. Of windows as other "
            "mountings of the sensor might show them (simulated: gain, axes, resonance) "
            f"{mounted.unknown:.0%} were unknown and {mounted.right:.0%} of the other answers right, at a mean "
            f"probability of {mounted.said:.2f}.",
            "Another place or season: all runs of a class are of one place.",
        ),
        lambda target: six_seconds(read_vibration_run(items[0].file), target.with_suffix(".csv")),
        "Features, windows and candidates were chosen on these runs, so all figures here are somewhat optimistic.",
    )


def otherwise_mounted(run, rng: np.random.Generator):
    """Change a run as another mounting might: a gain each for rates and accelerations, a resonance, x and y swapped."""
    mean = np.nanmean(run.channels, axis=0)
    moved = run.channels - mean
    gain = np.where([name.startswith("w") for name in run.names], *np.exp(rng.uniform(-1.1, 1.1, 2)))
    b, a = iirpeak(rng.uniform(5.0, 40.0), 3.0, fs=run.sample_rate_Hz)
    moved = gain * (moved + rng.uniform(0.0, 2.0) * lfilter(b, a, np.nan_to_num(moved), axis=0))
    if rng.random() < 0.5:
        turned = {"ax": "ay", "ay": "ax", "wx": "wy", "wy": "wx"}
        order = [run.names.index(turned.get(name, name)) for name in run.names]
        moved, mean = moved[:, order], mean[order]
    return replace(run, channels=mean + moved)


def six_seconds(run: VibrationRun, target: Path) -> Path:
    """Write six seconds of an inertial sensor's run as CSV, from the 20th on."""
    kept = slice(2000, 2000 + round(6 * run.sample_rate_Hz))
    table = np.column_stack([run.time_s[kept] - run.time_s[kept][0], run.channels[kept]])
    np.savetxt(target, table, fmt="%.5g", delimiter=",", header="time," + ",".join(run.names), comments="")
    return target


# Synthetic ground -----------------------------------------------------------------------------------------------------

SYNTHETIC_LIMITS = "on real ground its classes mean nothing"
SYNTHETIC_NEVER = ("Real ground, of whatever kind.",)
SYNTHETIC_SOURCES = "- the package's own synthetic world (`tests/studies/synthetic_samples.py`); a group is one site"


def train_synthetic(sense: str, sites_per_class: int = SITES_PER_CLASS) -> TrainingOutcome:
    """Train on synthetic ground: on sites of its own the linear model beats trees and kernels."""
    rng = np.random.default_rng(SYNTHETIC_SEED)
    if sense == "vibration":
        return train_vibration_runs(*labelled_runs(rng, sites_per_class), rng)
    if sense == "vision":
        looks = labelled_looks(rng, sites_per_class)
        return train_vision_patches(
            looks.patches, looks.labels, looks.groups, looks.blurred, rng, candidates=("logistic",)
        )
    sounds = labelled_sounds(rng, sites_per_class)
    return train_audio_windows(
        sounds.windows, sounds.labels, sounds.groups, sounds.snr_dB, rng, candidates=("logistic",)
    )


def synthetic(sense: str, example: Callable[[Path], Path]) -> Made:
    model = train_synthetic(sense).classifier
    score = model.report["balanced_accuracy"]
    short = f"balanced accuracy {scored(score)} on synthetic sites not trained on, n = {model.report['n_scored']}"
    return Made(model, SYNTHETIC_SOURCES, (), None, short, SYNTHETIC_LIMITS, SYNTHETIC_NEVER, example)


def vision_synthetic(data: Path) -> Made:
    def example(target: Path) -> Path:
        looks = labelled_looks(np.random.default_rng(SYNTHETIC_SEED + 2), 1)
        file = target.with_suffix(".png")
        cv2.imwrite(str(file), looks.patches[np.flatnonzero(~looks.blurred)[0]])
        return file

    return synthetic("vision", example)


def audio_synthetic(data: Path) -> Made:
    def example(target: Path) -> Path:
        sounds = labelled_sounds(np.random.default_rng(SYNTHETIC_SEED + 2), 1)
        file = target.with_suffix(".flac")
        soundfile.write(file, sounds.windows[np.argmax(sounds.snr_dB)], RATE_HZ)
        return file

    return synthetic("audio", example)


def vibration_synthetic(data: Path) -> Made:
    def example(target: Path) -> Path:
        runs, _ = labelled_runs(np.random.default_rng(SYNTHETIC_SEED + 2), 1)
        return six_seconds(runs[0], target.with_suffix(".csv"))

    return synthetic("vibration", example)


# Cards and index ------------------------------------------------------------------------------------------------------

RECIPES = {
    "audio-real": audio_real, "audio-synthetic": audio_synthetic, "vibration-real": vibration_real,
    "vibration-synthetic": vibration_synthetic, "vision-real": vision_real, "vision-synthetic": vision_synthetic,
}  # fmt: skip


def is_default(name: str, made: Made) -> bool:
    """Say whether a run may take it by itself: a synthetic one on synthetic ground, a real one that was judged."""
    return name.endswith("-synthetic") or (made.judged is not None and made.judged.overconfidence <= MOST_OVERCONFIDENT)


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def make(name: str, data: Path, out: Path) -> dict:
    """Make one model with its card and example; give its entry of the index."""
    made, seed = RECIPES[name](data), REAL_SEED if name.endswith("-real") else SYNTHETIC_SEED
    file = out / f"{name}.skops"
    if not file.exists() or TerrainClassifier.load(file).version != made.model.version:
        made.model.save(file)  # else the same content, whose bytes would differ
    default = is_default(name, made)
    file.with_suffix(".md").write_text(card(name, made, default, seed), encoding="utf-8")
    for old in out.glob(f"{name}-example.*"):
        old.unlink()
    example = made.example(out / f"{name}-example")
    rows = sense_named(made.model.modality).classify([example], TerrainClassifier.load(file))
    answers = [{key: value for key, value in row.items() if key != "file"} for row in rows]
    if not any(not row["unknown"] for row in answers):
        raise SystemExit(f"{name}: the example is unknown, and tests nothing")
    sense, ground = name.split("-")
    return {
        "sense": sense, "ground": ground, "default": default, "measured": made.in_short, "limits": made.limits,
        "classes": list(made.model.classes), "sha256": digest(file), "version": made.model.version,
        "example": example.name, "example_sha256": digest(example), "answers": answers,
    }  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(RECIPES)}; all by default")
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--out", type=Path, default=ROOT / "framework" / "core" / "trained")
    parser.add_argument("--write", action="store_true", help="of all models write docs/measured/models-shipped.json")
    asked = parser.parse_args(arguments)
    if asked.write and asked.names:
        parser.error("--write takes all models")
    if unknown := set(asked.names) - set(RECIPES):
        parser.error(f"no model {', '.join(sorted(unknown))}")
    if any(name.endswith("-real") for name in asked.names or RECIPES) and not asked.data.is_dir():
        parser.error(f"{asked.data} is not there: models of real ground need the recordings in it")
    asked.out.mkdir(parents=True, exist_ok=True)
    index = asked.out / "index.json"
    entries = json.loads(index.read_text()) if index.exists() else {}
    for name in asked.names or RECIPES:
        entries[name] = make(name, asked.data, asked.out)
        print(f"{name}: {entries[name]['measured']}; {'default' if entries[name]['default'] else 'not a default'}")
        index.write_text(json.dumps(dict(sorted(entries.items())), indent=1) + "\n", encoding="utf-8")
    if asked.write:
        write_table(entries)


if __name__ == "__main__":
    main()
