"""What `explain` finds in recordings without hidden effects: real wheels, and a simulation with other physics.

python tests/studies/mismatch_on_data.py        # prints tables in Markdown
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from bevameter import InputError, Vehicle, WheelTable, explain
from bevameter.framework.core.recording.types import Recording
from bevameter.framework.core.recording.wheel_file import read_wheel_file
from bevameter.identification.estimate.identify import open_recording
from bevameter.identification.explain.blocks import levels
from bevameter.identification.explain.explanation import Explanation
from bevameter.identification.explain.fit import fit, fit_textbook
from bevameter.identification.explain.held_out import hold_out
from bevameter.identification.explain.samples import gather
from bevameter.identification.mechanics.augmented import Entry
from bevameter.identification.rows.select import select_wheel_rows

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SHOWN = {"torque_Nm": ("torque [N m]", 1.0), "sinkage_m": ("sinkage [mm]", 1e3), "drawbar_pull_N": ("pull [N]", 1.0)}
TRUTH = {
    "granular-wheel": "c = 0, phi = 30 deg exactly",
    "single-wheel-sand": "angle of repose 29 deg (authors)",
    "Ding 2011": "c 0.25 kPa, phi 31.9 deg (published)",
    "Wang & Han 2016": "c 1.72 kPa, phi 40.6 deg (direct shear)",
}


def recordings() -> Iterator[tuple[str, Recording]]:
    """Give the recordings, one wheel each."""
    for name in ("granular-wheel", "single-wheel-sand"):
        yield name, open_recording(DATA / name / "wheel.csv", DATA / name / "vehicle.toml")
    source = DATA / "published-wheel-tests" / "wheel_tests.csv"
    tests = read_wheel_file(source)
    for radius in np.unique(tests["radius_m"]):
        rows = tests.select(tests["radius_m"] == radius)
        geometry = {name: float(rows[name][0]) for name in ("radius_m", "width_m")}
        vehicle = Vehicle.model_validate({"name": "test bench", "wheel": geometry})
        columns = {name: values for name, values in rows.columns.items() if name not in geometry}
        name = "Ding 2011" if "ding" in str(rows.run[0]) else "Wang & Han 2016"
        table = WheelTable(columns, None, rows.run, source)
        yield name, Recording(name, source, vehicle, None, "", "", wheel=table)


def left_out(recording: Recording, answer: Explanation) -> dict[str, dict[str, tuple[float, float]]]:
    """Held-out error of each channel without and with what was named, whole loads and whole slips held out."""
    rows = select_wheel_rows(recording)
    samples = gather(rows.table, rows.wheel, rows.vehicle)
    loads = levels(samples.drive.load_N / samples.drive.load_N.max(), 0.05)
    splits = {"one slip left out": levels(samples.drive.slip)}
    if loads.max() >= 2:
        splits["one load left out"] = loads
    table: dict[str, dict[str, tuple[float, float]]] = {}
    for split, block in splits.items():
        problem, textbook = fit_textbook(replace(samples, block=block))
        starts = [np.concatenate([textbook.vector, answer.vector[len(textbook.vector) :]]), answer.vector]
        fits = [fit(problem, answer.simulator, start, textbook.noise, Entry(textbook.theta_1)) for start in starts]
        chosen = max(fits, key=lambda fitted: fitted.score)
        errors = [np.sqrt(np.nanmean(hold_out(problem, each).residuals ** 2, axis=0)) for each in (textbook, chosen)]
        channels = [list(answer.fits)[position] for position in range(len(problem.answers))]
        table[split] = {channel: (float(a), float(b)) for channel, a, b in zip(channels, *errors, strict=True)}
    return table


def main() -> None:
    """Print what is found."""
    for name, recording in recordings():
        print(f"\n### {name}\n")
        try:
            answer = explain(recording)
        except InputError as error:
            print(f"refused: {error}")
            continue
        print(f"n = {answer.n}. Verdict: `{answer.verdict}`. {answer.summary}\n")
        print("| considered | probability | nats on held-out rows |\n|---|---|---|")
        for each in answer.candidates[:6]:
            print(f"| {each.effect} | {each.probability:.2f} | {each.heldout_nats:+.0f} |")
        if answer.simulator.effects:
            effects = " + ".join(effect.name for effect in answer.simulator.effects)
            print(f"\nHeld-out error, textbook wheel, then with {effects}:\n")
            print("| | " + " | ".join(SHOWN[channel][0] for channel in answer.fits) + " |")
            print("|---|" + "---|" * len(answer.fits))
            for split, errors in left_out(recording, answer).items():
                cells = [f"{SHOWN[c][1] * a:.3g} to {SHOWN[c][1] * b:.3g}" for c, (a, b) in errors.items()]
                print(f"| {split} | " + " | ".join(cells) + " |")
        c, phi = answer.soil["c_Pa"], answer.soil["phi_rad"]
        angle = f"{math.degrees(phi.value):.3g} ± {math.degrees(phi.sd):.2g} deg"
        print(
            f"\nSoil of the best model: c {c.value / 1e3:.2g} ± {c.sd / 1e3:.2g} kPa, phi {angle}; known: "
            f"{TRUTH[name]}. {answer.trust}"
        )


if __name__ == "__main__":
    main()
