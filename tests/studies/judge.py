"""How well `bevameter explain` names what recordings hide: make the recordings, run the tool, score its answers.

    python tests/studies/judge.py make  --set training --cache CACHE
    python tests/studies/judge.py run   --set training --cache CACHE --out answers.jsonl
    python tests/studies/judge.py run   --set training --cache CACHE --out answers.jsonl --leave-one-out
    python tests/studies/judge.py score --set training --cache CACHE answers.jsonl --compare other.jsonl --write NAME

Each stage resumes where it was stopped. `run` takes whatever `bevameter` is on PYTHONPATH. Instead of a named set,
`--seeds 793600 300` takes that many recordings of the study from that seed on, `--protocol ramps` makes drives of one
kind of them, and `--generator drives` takes whole drives of a vehicle instead. README.md in this folder says who may
see what.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from pathlib import Path

from judging import answers, recordings, summary
from judging.scorer import score
from measured import write
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    stages = parser.add_subparsers(required=True)
    which = argparse.ArgumentParser(add_help=False)
    which.add_argument("--cache", type=Path, required=True, help="folder of recordings and truths")
    one = which.add_mutually_exclusive_group(required=True)
    one.add_argument("--set", choices=recordings.SETS)
    one.add_argument("--seeds", type=int, nargs=2, metavar=("FIRST", "COUNT"), help="none of them frozen")
    which.add_argument("--generator", choices=recordings.STUDIES, default="study", help="with --seeds: of which one")
    which.add_argument("--protocol", help="with --seeds, of the study: all of this kind that can show it")

    stage = stages.add_parser("make", parents=[which], help="write the recordings that the cache lacks")
    stage.add_argument("--processes", type=int, default=2)
    stage.set_defaults(run=_make)

    stage = stages.add_parser("run", parents=[which], help="have the cache's recordings explained")
    stage.add_argument("--out", type=Path, required=True, help="JSON lines, added to")
    stage.add_argument(
        "--leave-one-out", action="store_true", help="only plain single effects, each left out of the catalogue"
    )
    stage.add_argument("--limit", type=int, help="at most so many recordings, the first of the set")
    stage.add_argument("--timeout", type=float, default=600.0, help="after which an answer is given up [s]")
    stage.add_argument("--processes", type=int, default=2)
    stage.set_defaults(run=_run)

    stage = stages.add_parser("score", parents=[which], help="print the table of measures")
    stage.add_argument("answers", type=Path)
    stage.add_argument("--compare", type=Path, help="another tool's answers; the recordings that both have")
    stage.add_argument("--each", action="store_true", help="list every recording, too; refused for frozen ones")
    stage.add_argument("--write", metavar="NAME", help="write the table to docs/measured/NAME.json, too")
    stage.set_defaults(run=_score)

    given = parser.parse_args(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # of the processes, which load BLAS after this
    try:
        given.run(given, _chosen(given))
    except ValueError as error:
        parser.error(str(error))


def _chosen(given: argparse.Namespace) -> recordings.RecordingSet:
    if given.set is not None:
        if given.protocol is not None:
            raise ValueError("--protocol goes with --seeds: a named set draws its own")
        return recordings.SETS[given.set]
    first, count = given.seeds
    if given.protocol is not None and given.generator != "study":
        raise ValueError(f"--protocol goes with the study: {given.generator} have none")
    chosen = recordings.RecordingSet(given.generator, range(first, first + count), given.protocol)
    if chosen.frozen:
        raise ValueError(f"--seeds {first} {count} holds frozen ones, which only a named set takes")
    return chosen


def _make(given: argparse.Namespace, chosen: recordings.RecordingSet) -> None:
    failed = {}

    def names() -> Iterable[str]:
        for name, error in recordings.make(given.cache, chosen, given.processes):
            if error is not None:
                failed[name] = error
            yield name

    _shown(names(), len(chosen.seeds), len(recordings.stored_truths(given.cache, chosen)))
    if failed:
        raise SystemExit("\n".join(f"{name}: {error}" for name, error in failed.items()))


def _run(given: argparse.Namespace, chosen: recordings.RecordingSet) -> None:
    truths = recordings.stored_truths(given.cache, chosen)
    left_out = {}
    if given.leave_one_out:
        hidden = {name: [effect["effect"] for effect in truth["effects"]] for name, truth in truths.items()}
        left_out = {
            name: slugs for name, slugs in hidden.items()
            if len(slugs) == 1 and slugs != ["beyond"] and truths[name]["level"] == "plain"
        }  # fmt: skip
    names = list(left_out if given.leave_one_out else truths)[: given.limit]
    done = answers.read_results(given.out)
    todo = [name for name in names if (name, given.leave_one_out) not in done]
    folders = {name: recordings.folder_of(given.cache, name) for name in todo}
    rows = answers.run(folders, left_out, given.processes, given.timeout)
    _shown(answers.append(given.out, rows), len(names), len(names) - len(todo))


def _score(given: argparse.Namespace, chosen: recordings.RecordingSet) -> None:
    if given.each and chosen.frozen:
        raise ValueError("--each: of frozen recordings nobody sees more than aggregates")
    truths = recordings.stored_truths(given.cache, chosen)
    results = {path.name: answers.read_results(path) for path in (given.answers, given.compare) if path is not None}
    both = [key for key in next(iter(results.values())) if key[0] in truths and all(key in r for r in results.values())]
    scores = {
        tool: {
            key: score(truths[key[0]], rows[key].get("answer"), rows[key]["seconds"], left_out=key[1])
            for key in sorted(both)
        }
        for tool, rows in results.items()
    }
    by_tool = {tool: list(of_tool.values()) for tool, of_tool in scores.items()}
    print(summary.table(by_tool))
    if given.write:
        columns, *rows = summary.cells(by_tool)
        which = given.set or f"{given.generator} from seed {given.seeds[0]} on"
        write(given.write, columns, rows, data=f"Simulated; {len(both)} answers on the set {which}")
    if given.each:
        for tool, of_tool in scores.items():
            print(f"\n### {tool}\n\n{summary.each({name: row for (name, _), row in of_tool.items()})}")


def _shown(names: Iterable[str], total: int, done: int) -> None:
    columns = (*Progress.get_default_columns()[:3], MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        job = bar.add_task("recordings", total=total, completed=done)
        for _ in names:
            bar.advance(job)


if __name__ == "__main__":
    main()
