"""How well `explain` names what is hidden in recordings of a generator that shares no code with it.

Each recording hides one or two effects of the catalogue, or none, at a strength set in nats (plain 1500, hidden 250,
buried 60); the tool sees the recording's folder alone, the scorer sees the truth. Recording number s is drawn from
seed s, whatever the number of recordings or processes; a study that was cut off goes on where it stopped.

    python docs/studies/concealed_physics.py --recordings 320 --processes 2 --out results.jsonl
    python docs/studies/concealed_physics.py --recordings 60 --leave-one-out --out left_out.jsonl
    python docs/studies/concealed_physics.py --recordings 60 --protocol ramps --out ramps.jsonl
    python docs/studies/concealed_physics.py --recordings 60 --protocol turns --out turns.jsonl
    python docs/studies/concealed_physics.py --recordings 0 --out results.jsonl        # only the table
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np
from bevameter.framework.scenario.concealed import summary
from bevameter.framework.scenario.concealed.conceal import ConcealedRecording, conceal
from bevameter.framework.scenario.concealed.drives import LACKED, PROTOCOL_SHARES, PROTOCOLS, needs_of
from bevameter.framework.scenario.concealed.effects import catalogue
from bevameter.framework.scenario.concealed.rivals import rivals
from bevameter.framework.scenario.concealed.scorer import score, score_left_out
from bevameter.framework.scenario.concealed.strength import LEVELS
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

Task = tuple[int, bool, bool, str | None]
"""Seed, whether what is hidden is left out of the catalogue, whether rivals are fitted, and the protocol."""

NULLS, PAIRS = 0.30, 0.15
"""Shares of recordings with nothing and with two effects hidden."""

OURS = {
    ("torque_offset", "offset_Nm"): ("T_0", 0.0), ("torque_gain", "gain"): ("g", 1.0),
    ("load_gain", "gain"): ("g", 1.0), ("sinkage_offset", "offset_m"): ("z_0", 0.0),
    ("rolling_radius", "radius_ratio"): ("e", 1.0), ("time_lag", "lag_s"): ("tau", 0.0),
    ("exit_angle", "exit_ratio"): ("s", 0.0), ("shear_hump", "residual_ratio"): ("K_r", 0.0),
    ("inertia", "wheel_inertia_kg_m2"): ("J", 0.0), ("inertia", "mass_kg"): ("m", 0.0),
    ("slope_gravity", "mass_kg"): ("m", 0.0), ("slope_gravity", "load_share"): ("s", 0.0),
    ("drivetrain_friction", "viscous_Nms"): ("b_v", 0.0),
}  # fmt: skip
"""The tool's name of a parameter of the generator, and what to add to its value; a low-pass is no delay."""


def draw(seed: int, left_out: bool, asked: str | None = None) -> tuple[tuple[str, ...], str, str]:
    """Give what recording number `seed` hides, its level and its protocol, the one `asked` for where that can show it.

    Nulls, single effects and pairs follow the golden ratio, and slugs are dealt out in shuffled rounds, so that any
    stretch of seeds holds its share of all of them.
    """
    slugs, levels = list(catalogue()), list(LEVELS)
    rng = np.random.default_rng([9177, seed])
    turn = int(np.random.default_rng([9176, seed // len(slugs)]).permutation(len(slugs))[seed % len(slugs)])
    lot = (seed * 0.6180339887) % 1.0
    if left_out:
        effects: tuple[str, ...] = (slugs[turn],)
    elif lot < NULLS:
        effects = ()
    elif lot < NULLS + PAIRS:
        effects = tuple(str(slug) for slug in rng.choice(slugs, 2, replace=False))
    else:
        effects = (slugs[turn],)
    level = "plain" if left_out else levels[int(rng.integers(3))]
    protocol = str(rng.choice(PROTOCOLS, p=PROTOCOL_SHARES))
    return effects, level, shown_by(asked or protocol, effects)


def shown_by(protocol: str, effects: tuple[str, ...]) -> str:
    """Give the protocol, or a bench test where it cannot show the effects."""
    return "bench" if needs_of(effects) & LACKED.get(protocol, frozenset()) else protocol


def make(seed: int, left_out: bool, asked: str | None = None) -> ConcealedRecording:
    """Make recording number `seed`; an effect that cannot be made so strong is hidden at the next level below.

    Two effects that stand for each other in this drive are replaced by the next pair.
    """
    effects, level, protocol = draw(seed, left_out, asked)
    names = list(LEVELS)
    slugs, rng = list(catalogue()), np.random.default_rng([9178, seed])
    made = None
    for _ in range(3):
        for lower in names[names.index(level) :]:
            made = conceal(seed, effects, lower, protocol)
            if made.truth["reached"]:
                return made
        if len(effects) == 2:
            effects = tuple(str(slug) for slug in rng.choice(slugs, 2, replace=False))
            protocol = shown_by(asked or protocol, effects)
    assert made is not None
    return made


def one(task: Task) -> dict[str, Any]:
    """Make a recording, have it explained, and score the answer; where it is wrong, ask whether the data could tell."""
    seed, left_out, compare, protocol = task
    made = make(seed, left_out, protocol)
    with tempfile.TemporaryDirectory() as place:
        # the name gives nothing away, and the truth is never written
        folder = made.write(Path(place) / f"recording-{seed}")
        began = time.perf_counter()
        answer, failure = explained(folder, made, left_out)
        seconds = time.perf_counter() - began
    found = score_left_out(made.truth, answer) if left_out else score(made.truth, answer, seconds)
    nearest = None
    if compare and len(made.effects) == 1 and found.get("named") is False:
        nearest = rivals(made)
    return {**found, "failure": failure, "rivals": nearest, "truth": made.truth, "answer": answer}


def explained(folder: Path, made: ConcealedRecording, left_out: bool) -> tuple[dict[str, Any] | None, str | None]:
    """Ask the tool; give its answer as the contract's JSON, or None and what went wrong."""
    import bevameter
    from bevameter.identification.mismatch.explanation import to_json

    options: dict[str, Any] = {}
    if (folder / "soil.toml").is_file():
        options["soil"] = folder / "soil.toml"
    if left_out:
        gone = {effect["effect"] for effect in made.truth["effects"]}
        options["catalogue"] = [slug for slug in catalogue() if slug not in gone]
    try:
        answer = to_json(bevameter.explain(folder, **options))
        return renamed(json.loads(json.dumps(answer))), None
    except Exception as error:  # a failure of the tool is a result of the study
        return None, f"{type(error).__name__}: {error}"


def renamed(answer: dict[str, Any]) -> dict[str, Any]:
    """Add the generator's names of the parameters that mean the same."""
    for item in answer["missing"]:
        given = item["parameters"]
        for (slug, name), (ours, more) in OURS.items():
            if item["effect"] == slug and ours in given and "low-pass" not in item["form"]:
                given[name] = {**given[ours], "value": given[ours]["value"] + more}
    return answer


def done(path: Path) -> dict[int, dict[str, Any]]:
    """Read the scores that there are already, by seed; a last line that was cut off is dropped."""
    scores: dict[int, dict[str, Any]] = {}
    if not path.is_file():
        return scores
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        scores[row["seed"]] = row
    return scores


def run(tasks: list[Task], processes: int) -> Iterator[dict[str, Any]]:
    """Yield scores as they come."""
    if processes == 1:
        yield from map(one, tasks)
        return
    with ProcessPoolExecutor(max_workers=processes) as pool:
        for future in as_completed([pool.submit(one, task) for task in tasks]):
            yield future.result()


def report(scores: list[dict[str, Any]], left_out: bool) -> str:
    """Give the study as Markdown."""
    if left_out:
        return summary.left_out_table([s for s in scores if s["reached"]])
    heads = ("What was named", "Effect by effect", "Calibration of the stated probabilities")
    tables = (summary.table(scores), summary.by_effect(scores), summary.calibration_table(scores))
    return "\n\n".join(f"### {head}\n\n{body}" for head, body in zip(heads, tables, strict=True))


def main() -> None:
    """Run what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=int, default=320)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0, help="number of the first recording")
    parser.add_argument("--out", type=Path, default=Path("concealed_physics.jsonl"), help="JSON lines, added to")
    parser.add_argument("--markdown", type=Path, help="write the tables here too")
    parser.add_argument("--leave-one-out", action="store_true", help="take what is hidden out of the catalogue")
    parser.add_argument(
        "--rivals", action="store_true", help="where an effect was not named, fit all others to it (10 to 60 s each)"
    )
    parser.add_argument("--protocol", choices=PROTOCOLS, help="make all of this kind that can show what is hidden")
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    scores = done(given.out)
    seeds = range(given.seed, given.seed + given.recordings)
    tasks = [(seed, given.leave_one_out, given.rivals, given.protocol) for seed in seeds if seed not in scores]
    console = Console(stderr=True)
    with Progress(
        *Progress.get_default_columns()[:3], MofNCompleteColumn(), TimeRemainingColumn(), console=console
    ) as bar, given.out.open("a", encoding="utf-8") as file:  # fmt: skip
        if file.tell() and not given.out.read_text(encoding="utf-8").endswith("\n"):
            file.write("\n")  # the last line was cut off
        job = bar.add_task("recordings", total=len(seeds), completed=len(seeds) - len(tasks))
        for row in run(tasks, given.processes):
            file.write(json.dumps(row) + "\n")
            file.flush()
            scores[row["seed"]] = row
            bar.advance(job)
    text = report([scores[seed] for seed in sorted(scores)], given.leave_one_out)
    if given.markdown is not None:
        given.markdown.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
