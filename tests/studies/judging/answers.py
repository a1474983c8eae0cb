"""`bevameter explain` over a cache of recordings, in processes that are ended after a time limit."""

from __future__ import annotations

import importlib
import json
import multiprocessing
import time
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

_SPAWN = multiprocessing.get_context("spawn")


def run(
    folders: Mapping[str, Path], left_out: Mapping[str, Collection[str]], processes: int, timeout_s: float
) -> Iterator[dict[str, Any]]:
    """Explain recordings, and give each result as it comes.

    Parameters
    ----------
    folders
        Of the recordings, by name.
    left_out
        Effects that the tool's catalogue is to lack, by the recording's name; empty where it has all.
    processes
        Recordings explained at a time.
    timeout_s
    Longest time for an answer [s].

    Yields
    ------
    dict
        For JSON: `name`, `left_out`, `seconds`, and `answer` or `failure`. A failure of the tool is a result.
    """
    idle: SimpleQueue[_Explainer] = SimpleQueue()
    for _ in range(processes):
        idle.put(_Explainer())

    def explained(name: str) -> dict[str, Any]:
        explainer = idle.get()
        try:
            without = sorted(left_out.get(name, ()))
            return {"name": name, "left_out": without, **explainer.explain(folders[name], without, timeout_s)}
        finally:
            idle.put(explainer)

    pool = ThreadPoolExecutor(processes)
    try:
        for job in as_completed([pool.submit(explained, name) for name in folders]):
            yield job.result()
    finally:
        pool.shutdown(cancel_futures=True)
        while not idle.empty():
            idle.get().end()


class _Explainer:
    """A process that explains recordings one after the other, started when it is needed."""

    def __init__(self) -> None:
        self._process: Any = None
        self._pipe: Any = None

    def explain(self, folder: Path, without: list[str], timeout_s: float) -> dict[str, Any]:
        """Give seconds and answer or failure; a new process answers twice, as the first answer compiles kernels."""
        if self._process is None:
            self._pipe, far = _SPAWN.Pipe()
            self._process = _SPAWN.Process(target=_serve, args=(far,))
            self._process.start()
            far.close()
            if self._pipe.recv() and "failure" in (first := self._answer(folder, without, timeout_s)):
                return first
        return self._answer(folder, without, timeout_s)

    def _answer(self, folder: Path, without: list[str], timeout_s: float) -> dict[str, Any]:
        began = time.perf_counter()
        self._pipe.send((folder, without))
        try:
            if self._pipe.poll(timeout_s):
                return self._pipe.recv()
            failure = f"no answer after {timeout_s:g} s"
        except EOFError:
            failure = "the process died"
        self.end()
        return {"seconds": time.perf_counter() - began, "failure": failure}

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
        self._process = None


def _serve(pipe: Connection) -> None:
    import bevameter

    pipe.send(bevameter.explain is not None)  # imported, or this process has ended with the error
    while True:
        try:
            folder, without = pipe.recv()
        except EOFError:  # the parent process has ended
            return
        began = time.perf_counter()
        try:
            said = {"answer": answer_of(folder, without)}
        except Exception as error:
            said = {"failure": f"{type(error).__name__}: {error}"}
        pipe.send({"seconds": time.perf_counter() - began, **said})


def answer_of(folder: Path, without: Collection[str] = ()) -> dict[str, Any]:
    """Give the answer to a recording as the contract's JSON, by a tool whose catalogue lacks the effects `without`."""
    import bevameter

    options: dict[str, Any] = {}
    if (folder / "soil.toml").is_file():
        options["soil"] = folder / "soil.toml"
    if without:
        slugs = _first("SLUGS", "identification.effects.registry", "identification.effects.catalogue")
        options["catalogue"] = [slug for slug in slugs if slug not in without]
    found: Any = bevameter.explain(folder, **options)
    if hasattr(found, "to_json"):
        answer = found.to_json()
    else:
        places = ("identification.explain.answer", "identification.mismatch.explanation")
        answer = _first("to_json", *places)(found)
    return json.loads(answer if isinstance(answer, str) else json.dumps(answer))


def _first(name: str, *modules: str) -> Any:
    """Give an object from the first of the package's modules that has it: versions keep it in different places."""
    for module in modules:
        try:
            return getattr(importlib.import_module(f"bevameter.{module}"), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"no {name} in bevameter, looked for in {', '.join(modules)}")


def read_results(path: Path) -> dict[tuple[str, bool], dict[str, Any]]:
    """Read JSON lines by name and whether effects were left out; a last line that was cut off is dropped."""
    results = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        results[row["name"], bool(row["left_out"])] = row
    return results


def append(path: Path, rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    """Write each row as a line as soon as it comes, and give its name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    before = path.read_text(encoding="utf-8") if path.is_file() else ""
    with path.open("a", encoding="utf-8") as file:
        if before and not before.endswith("\n"):
            file.write("\n")  # the last line was cut off
        for row in rows:
            file.write(json.dumps(row) + "\n")
            file.flush()
            yield row["name"]
