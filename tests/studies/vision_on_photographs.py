"""Vision on photographs of grounds that were held out: the package against a plain support vector machine.

    python tests/studies/vision_on_photographs.py FOLDER [--method package|svm] [--split photograph|source]
        [--backbone NETWORK.onnx] [--write]

FOLDER is labelled (`index.csv` with file, class, group, source). Splits: `photograph`, five folds by group, and
`source`, each source in turn against the others, whose shared groups are left out. Balanced accuracy is of photographs,
with a 95 % interval; an answer of "unknown" counts as wrong. The same models answer degraded copies of the photographs.
"""

from __future__ import annotations

import argparse
import time
from functools import partial

import cv2
import numpy as np
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.classifier.scores import accuracy_intervals, confusion_by_unit
from bevameter.framework.core.recording.camera import read_image
from bevameter.vision.augment import motion_blur
from bevameter.vision.backbone import open_backbone
from bevameter.vision.classify import image_evidence
from bevameter.vision.train import train_vision_arrays
from measured import write
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC


def noisy(image, sd, rng):
    """Add white noise of a standard deviation [of 255] to an image (h, w, 3)."""
    return np.clip(image + rng.normal(0, sd, image.shape) + 0.5, 0, 255).astype(np.uint8)


NO_GROUND = "noise alone"
CONDITIONS = {
    "as it is": lambda image, rng: image,
    "blur of 11 px": lambda image, rng: motion_blur(image, 11, rng.uniform(0, np.pi)),
    "a quarter of the light": lambda image, rng: (image * 0.25).astype(np.uint8),
    "noise of 20 of 255": lambda image, rng: noisy(image, 20, rng),
    "noise as strong as the contrast": lambda image, rng: noisy(image, image.mean(axis=2).std(), rng),
    NO_GROUND: lambda image, rng: noisy(np.full_like(image, 128), rng.uniform(20, 80), rng),
}
METHODS = {"package": "built-in features", "svm": "support vector machine on HSV, LBP, GLCM"}
SPLITS = {"photograph": "photographs, five folds", "source": "the other source"}


# A plain method: what is put together in an afternoon -----------------------------------------------------------------


def patterns(grey, radius):
    """Uniform rotation-invariant local binary patterns, (10,)."""
    height, width = grey.shape
    code = np.zeros((height - 2 * radius, width - 2 * radius), dtype=int)
    for bit, (down, right) in enumerate([(-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1)]):
        top, left = radius * (1 + down), radius * (1 + right)
        there = grey[top : top + code.shape[0], left : left + code.shape[1]]
        code |= (there >= grey[radius:-radius, radius:-radius]).astype(int) << bit
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1
    turns = (bits != np.roll(bits, 1, axis=1)).sum(axis=1)
    return np.bincount(np.where(turns <= 2, bits.sum(axis=1), 9)[code.ravel()], minlength=10) / code.size


def cooccurrence(grey, lag):
    """Contrast, dissimilarity, homogeneity, energy and correlation of co-occurrences of 8 levels at a lag, (5,)."""
    level, found = (grey // 32).astype(int), []
    i, j = np.mgrid[0:8, 0:8]
    for here, there in (
        (level[:, :-lag], level[:, lag:]), (level[:-lag], level[lag:]),
        (level[:-lag, :-lag], level[lag:, lag:]), (level[:-lag, lag:], level[lag:, :-lag]),
    ):  # fmt: skip
        p = np.bincount((8 * here + there).ravel(), minlength=64).reshape(8, 8)
        p = (p + p.T) / (2 * p.sum())
        mean = (i * p).sum()
        spread = ((i - mean) ** 2 * p).sum() + 1e-9
        moments = ((i - j) ** 2 * p, abs(i - j) * p, p / (1 + (i - j) ** 2), p**2, (i - mean) * (j - mean) * p / spread)
        found.append([moment.sum() for moment in moments])
    return np.mean(found, axis=0)


def plain_features(image):
    """Histograms of hue, saturation and value, local binary patterns, co-occurrences: of 9 crops of 64 px, (9, 77)."""
    short = min(image.shape[:2])
    size = (max(64, round(128 * image.shape[1] / short)), max(64, round(128 * image.shape[0] / short)))
    image, rows = cv2.resize(image, size, interpolation=cv2.INTER_AREA), []
    for top in np.linspace(0, image.shape[0] - 64, 3).astype(int):
        for left in np.linspace(0, image.shape[1] - 64, 3).astype(int):
            crop = image[top : top + 64, left : left + 64]
            hsv, grey = cv2.cvtColor(crop, cv2.COLOR_BGR2HSV), cv2.cvtColor(crop, cv2.COLOR_BGR2GRAY)
            parts = [
                np.histogram(hsv[..., channel], bins, (0, most))[0] / grey.size
                for channel, bins, most in ((0, 16, 180), (1, 8, 256), (2, 8, 256))
            ]
            rows.append(
                np.concatenate(
                    [*parts, *(patterns(grey, r) for r in (1, 2, 3)), *(cooccurrence(grey, d) for d in (1, 2, 4))]
                )
            )
    return np.array(rows)


def svm(images, labels, groups):
    """A support vector machine on plain features; gives class names of images, and no probability."""
    rows = [plain_features(image) for image in images]
    model = make_pipeline(StandardScaler(), SVC(C=10, gamma=0.003, class_weight="balanced"))
    model.fit(np.concatenate(rows), np.repeat(labels, 9))

    def named(images):
        votes = [model.decision_function(plain_features(image)).sum(axis=0) for image in images]
        return model.classes_[np.argmax(votes, axis=1)], np.full(len(images), np.nan)

    return named


def package(images, labels, groups, backbone=None):
    """The package's own: class names of images, "unknown" where it does not say, and their probabilities."""
    model = train_vision_arrays(images, labels, groups, np.random.default_rng(0), backbone=backbone).classifier

    def named(images):
        evidence = image_evidence(model, images)
        best = np.array(evidence.classes)[evidence.probabilities.argmax(axis=1)]
        return np.where(evidence.unknown, "unknown", best), evidence.probabilities.max(axis=1)

    return named


def calibration(stated, right):
    """Share that is right, mean stated probability, calibration error and share wrong among the surest, of n answers.

    `stated` (n,) is not finite where a method states none: the last three are then not finite either. All are not
    finite where there is no answer.
    """
    if not len(stated):
        return np.nan, np.nan, np.nan, np.nan
    if not np.isfinite(stated).all():
        return right.mean(), np.nan, np.nan, np.nan
    bins = np.minimum((10 * stated).astype(int), 9)
    apart = np.bincount(bins, stated, 10) - np.bincount(bins, right.astype(float), 10)
    surest = np.argsort(-stated)[: round(0.8 * len(stated))]
    return right.mean(), stated.mean(), np.abs(apart).sum() / len(stated), 1 - right[surest].mean()


def written(share):
    """A share with two digits, or a dash where there is none."""
    return f"{share:.2f}" if np.isfinite(share) else "-"


def splits(kind, labels, groups, sources, seed):
    """Indices to train on and to test on."""
    if kind == "photograph":
        yield from StratifiedGroupKFold(5, shuffle=True, random_state=seed).split(labels, labels, groups)
        return
    for source in sorted(set(sources)):
        test = sources == source
        train = ~test & ~np.isin(groups, groups[test])
        if len(set(labels[train])) > len(set(labels)) / 2:  # a source of a photograph or two is no test
            yield np.flatnonzero(train), np.flatnonzero(test)


def study(method, split, images, labels, groups, sources, backbone, seed):
    """Train and answer, print a table; cells of the conditions: balanced accuracy, and unknown and calibration."""
    train = svm if method == "svm" else partial(package, backbone=backbone)
    truths, units, answers, stated = [], [], {name: [] for name in CONDITIONS}, {name: [] for name in CONDITIONS}
    foreign, start = [], time.perf_counter()
    for inside, test in splits(split, labels, groups, sources, seed):
        named = train([images[i] for i in inside], labels[inside], groups[inside])
        strange = ~np.isin(labels[test], labels[inside])
        if strange.any():
            foreign += list(named([images[i] for i in test[strange]])[0])
        test = test[~strange]
        truths += list(labels[test])
        units += list(groups[test])
        rng = np.random.default_rng(0)
        for name, change in CONDITIONS.items():
            for part, found in zip((answers, stated), named([change(images[i], rng) for i in test]), strict=True):
                part[name] += list(found)
    names = [*sorted(set(labels)), "unknown"]
    truth, unit = np.array([names.index(name) for name in truths]), np.unique(units, return_inverse=True)[1]
    with_one = " with a backbone" if backbone is not None and method != "svm" else ""
    print(f"{method}{with_one}, split by {split}, n = {len(truth)}, {time.perf_counter() - start:.0f} s")
    accuracies, calibrations = [], []
    for name, given in answers.items():
        said = np.array([names.index(each) for each in given])
        by_unit = confusion_by_unit(truth, said, unit, len(names))
        score = accuracy_intervals(by_unit)["balanced_accuracy"]
        known, right = said != len(names) - 1, said == truth
        if name != NO_GROUND:
            accuracies.append(f"{score['value']:.2f} ({score['low']:.2f} to {score['high']:.2f})")
        calibrations.append((1 - known.mean(), *calibration(np.array(stated[name])[known], right[known])))
        print(
            f"{name:24s} balanced accuracy {score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f}), "
            f"unknown, right where known, stated, calibration error, wrong among the surest 80 %: "
            f"{', '.join(f'{each:.3f}' for each in calibrations[-1])}"
        )
        if name == "as it is":
            table = by_unit.sum(axis=0).astype(int)
            for index, row in enumerate(table[:-1]):
                print(f"  {names[index]:14s} {row[index] / max(row.sum(), 1):.2f}  {row.tolist()}")
    if foreign:
        print(f"of classes not trained on: n = {len(foreign)}, unknown {np.mean(np.array(foreign) == 'unknown'):.2f}")
    return len(truth), accuracies, calibrations


def main():
    """Train, answer, print a table; with `--write` all methods and splits, for the documentation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder")
    parser.add_argument("--method", choices=METHODS, default="package")
    parser.add_argument("--split", choices=SPLITS, default="photograph")
    parser.add_argument("--backbone")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help="all methods and splits, into docs/measured")
    asked = parser.parse_args()
    items = read_labelled(asked.folder)
    images = [read_image(item.file) for item in items]
    labels, groups = np.array([item.class_name for item in items]), np.array([item.group for item in items])
    sources = np.array([str(item.extra["source"]) for item in items])
    backbone = open_backbone(asked.backbone) if asked.backbone else None
    accuracies, probabilities = [], []
    for split in SPLITS if asked.write else (asked.split,):
        for method in METHODS if asked.write else (asked.method,):
            n, scores, calibrations = study(method, split, images, labels, groups, sources, backbone, asked.seed)
            accuracies.append((f"{SPLITS[split]}, n = {n}", METHODS[method], *scores))
            if method == "package":
                rows = zip(CONDITIONS, calibrations, strict=True)
                probabilities += [(SPLITS[split], name, *map(written, row)) for name, row in rows]
    if asked.write:
        data = f"Real; {len(images)} photographs of {len(set(labels))} classes in {len(set(groups))} groups"
        shown = (name for name in CONDITIONS if name != NO_GROUND)
        write("photographs", ("held out", "method", *shown), accuracies, data=f"{data}, balanced accuracy (95 %)")
        measures = ("unknown", "right", "stated", "calibration error", "wrong among the surest 80 %")
        columns, data = ("held out", "photographs", *measures), f"{data}; right and stated where not unknown"
        write("photographs-probabilities", columns, probabilities, data=data)


if __name__ == "__main__":
    main()
