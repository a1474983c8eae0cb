"""The main job over many recordings: processed at once, stored by one writer in the order in which they were given."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..database.frames import OriginsDiffer
from ..database.store import TerrainDatabase
from .conditions import Conditions, url_of
from .core.arguments import path_of, refused, whole
from .core.errors import BevameterError, InputError
from .core.origin import Offset, Origin
from .core.recording.types import Recording
from .core.vehicle import Vehicle
from .default_models import Models, ModelsGiven, find_models
from .placement import Claim, Frames, Placement
from .segments import CELL_SIZE_M
from .sense_map import Progress
from .summary import TraverseSummary
from .traverse import Processed, process, store
from .workers import ClusterWorkers, LocalWorkers, WorkerLost, Workers

if TYPE_CHECKING:
    from distributed import Client

_POLL_S = 0.5

MOST_AHEAD = 256
"""Recordings that are begun beyond the first one that is not stored: what was made of them waits in memory."""


@dataclass(frozen=True)
class FailedRecording:
    """A recording that was not processed.

    Parameters
    ----------
    source
        Its path.
    problem
        Why, in one line that names it.
    """

    source: str
    problem: str

    def as_dict(self) -> dict[str, str]:
        """Give it as `bevameter run --json` writes it."""
        return {"source": self.source, "error": self.problem}


Outcome = TraverseSummary | FailedRecording
"""What became of a recording."""

Results = Generator[Processed | FailedRecording, None, None]
"""What came out of processing, in the order in which recordings are given."""


def run_traverses(
    recordings: Sequence[Recording | str | Path],
    database: TerrainDatabase | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    topics: str | Path | None = None,
    models: Models | ModelsGiven = None,
    cell_size_m: float = CELL_SIZE_M,
    site: str | None = None,
    origin: Origin | None = None,
    offset: Offset | None = None,
    ground: str | None = None,
    workers: int = 1,
    client: Client | None = None,
    progress: Progress | None = None,
    finished: Callable[[Outcome], None] | None = None,
) -> tuple[Outcome, ...]:
    """Turn recorded drives into observations of terrain and soil, and add them to a database.

    Each is processed as by `run_traverse`, in this process, in several of this machine, or on a Dask cluster. Only this
    process reads and writes the database: one transaction a drive, in the order in which recordings are given. So the
    database holds the same whichever way is taken. What it knows of the physics of classes, and the models, are those
    at the beginning. A run that was interrupted has stored whole drives, and the same run again processes the rest.

    Parameters
    ----------
    recordings
        Their paths; with one worker and no client also recordings.
    database
        The terrain database, or its path or URL; made if missing.
    vehicle, topics
        For all of them, instead of their own: the vehicle, or its TOML file; and the topic map of bags.
    models
        The classifiers, or where they are, as in `run_traverse`. Other processes are sent those that this one finds.
    cell_size_m
        Edge of a ground cell [m].
    site, origin, offset
        For all of them, instead of their own: as in `run_traverse`. Of recordings at a site that the database does not
        know, the first one that says where its frame lies gives the site's frame.
    ground
        Class of the ground of all of them, as in `run_traverse`.
    workers
        How many processes work at once [-]; with 1 it is this one. Each takes its share of the cores, and as much
        memory as a run does.
    client
        Of `dask.distributed`, instead of processes of this machine. The workers of the cluster need the same version of
        Bevameter, and read the recordings by the same paths.
    progress
        Called with ``"recordings"`` and the share of them that is done; with one worker and no client also with each
        stage of a recording. What it raises ends the run.
    finished
        Called with each outcome as soon as it is stored, in the order in which recordings are given.

    Returns
    -------
    tuple of TraverseSummary or FailedRecording
        One a recording. One that cannot be used, whose processing has a defect, or whose process died, fails alone.

    Raises
    ------
    InputError
        An argument, the vehicle, a model or the database cannot be used. What was stored before stays.
    """
    given = _checked(recordings, workers, client)
    report: Progress = progress or (lambda stage, share: None)
    conditions = Conditions.of(
        database, vehicle=vehicle, topics=topics, cell_size_m=cell_size_m, site=site, origin=origin, offset=offset,
        ground=ground, several=len(given) > 1,
    )  # fmt: skip
    found = FoundModels.find(models, url_of(database))
    if client is not None:
        given = [each.absolute() for each in given if isinstance(each, Path)]  # workers have other working folders
        if conditions.topics is not None:
            conditions = replace(conditions, topics=conditions.topics.absolute())
        results = _by_workers(ClusterWorkers(client), given, conditions, found)
    elif min(workers, len(given)) > 1:
        results = _by_workers(LocalWorkers(min(workers, len(given))), given, conditions, found)
    else:
        results = _in_this_process(given, conditions, found, report)
    outcomes: list[Outcome] = []
    report("recordings", 0.0)
    with closing(results):
        for result in results:
            # Only now: the database is written by nobody but this process.
            outcomes.append(result if isinstance(result, FailedRecording) else _stored(result, database))
            if finished is not None:
                finished(outcomes[-1])
            report("recordings", len(outcomes) / len(given))
    return tuple(outcomes)


def _checked(
    recordings: Sequence[Recording | str | Path], workers: int, client: Client | None
) -> tuple[Recording | Path, ...]:
    """Give the recordings; raises `InputError` where they are none, or cannot be processed where it is wanted."""
    wanted = "a list of recordings, or of their paths"
    if isinstance(recordings, str | Path | Recording) or not isinstance(recordings, Iterable):
        raise refused("recordings", recordings, wanted)
    given = tuple(each if isinstance(each, Recording) else path_of("recordings", each, wanted) for each in recordings)
    if whole("workers", workers, "a whole number of processes, at least 1") < 1:
        raise refused("workers", workers, "a whole number of processes, at least 1")
    if client is not None and workers > 1:
        raise InputError("workers", f"{workers}, and a cluster's client, too", expected="one of them")
    if client is not None or min(workers, len(given)) > 1:
        for each in given:
            if isinstance(each, Recording):
                raise InputError("recordings", f"{each.name!r}, which was read", expected="a path, for other processes")
    return given


@dataclass(frozen=True)
class FoundModels:
    """The models of a run over several recordings, as they are sent to other processes.

    Parameters
    ----------
    by_world
        Those of recordings that call themselves synthetic (True), and of others (False).
    """

    by_world: Mapping[bool, Models]

    @staticmethod
    def find(models: Models | ModelsGiven, database: str | Path) -> FoundModels:
        """Find those of all senses; raises `InputError` where one cannot be read."""
        if isinstance(models, Models):
            return FoundModels({True: models, False: models})
        return FoundModels({world: find_models(models, database, synthetic=world) for world in (True, False)})

    def of(self, senses: Sequence[str], synthetic: bool) -> Models:
        """Give the models of a recording's senses."""
        return self.by_world[synthetic].of(senses)


class _Open(Exception):
    """Where a recording's places are put depends on recordings before it; what it says of its frame is the argument."""


class _Ended(BaseException):
    """Who was told of the progress raised, which ends the run: it is no defect of a recording's processing."""


def _in_this_process(
    given: Sequence[Recording | Path], conditions: Conditions, found: FoundModels, report: Progress
) -> Results:
    def told(stage: str, share: float) -> None:
        try:
            report(stage, share)
        except Exception as error:
            raise _Ended from error

    frames = Frames(conditions.frames)
    for recording in given:
        try:
            result = process(recording, conditions, found.of, frames.place, told)
        except _Ended as ended:
            raise (ended.__cause__ or ended) from None
        except Exception as error:
            result = _failed(recording, error)
        yield result


def _by_workers(
    started: Workers, given: Sequence[Recording | Path], conditions: Conditions, found: FoundModels
) -> Results:
    """Have recordings processed, and yield what comes out, in their order.

    One whose frame depends on others is processed once it is known what those before it say: as if one by one.
    """
    waiting: dict[int, Processed | FailedRecording] = {}
    placements: dict[int, Placement] = {}
    claims: dict[int, Claim] = {}
    pending: dict[Future[Any], int] = {}
    unread, frames = set(range(len(given))), Frames(conditions.frames)
    begun = following = 0
    with started as workers:
        sent = workers.shared((conditions, found))

        def send(number: int) -> None:
            pending[workers.submit(_attempt, given[number], sent, placements.get(number))] = number

        while following < len(given):
            while begun < min(following + MOST_AHEAD, len(given)):
                send(begun)
                begun += 1
            # Windows lets Ctrl-C through between waits only.
            done, _ = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
            for future in done:
                number = pending.pop(future)
                result = _result(future, given[number])
                unread.discard(number)
                if isinstance(result, _Open):
                    claims[number] = result.args[0]
                else:
                    waiting[number] = result
            for number in sorted(claims):
                if unread and min(unread) < number:
                    break
                placements[number] = frames.place(claims.pop(number))
                send(number)
            while following in waiting:
                yield waiting.pop(following)
                following += 1


def _result(future: Future[Any], recording: Recording | Path) -> Processed | FailedRecording | _Open:
    """Give what a worker returned; where it was lost, the recording has failed."""
    try:
        return future.result()
    except BevameterError as error:
        return _failed(recording, error)
    except CancelledError:
        return _failed(recording, WorkerLost("the connection to the cluster was lost"))
    except Exception as error:  # of the cluster: what the function raises comes as a result
        died = "its worker on the cluster died, " * (type(error).__name__ == "KilledWorker")
        return _failed(recording, WorkerLost(f"{died}{type(error).__name__}: {error!s:.200}"))


def _attempt(
    recording: Path, sent: tuple[Conditions, FoundModels], placement: Placement | None
) -> Processed | FailedRecording | _Open:
    """Process a recording, in another process; an error is returned as text, which any process can read."""
    conditions, models = sent

    def placed(claim: Claim) -> Placement:
        frames = Frames(conditions.frames)
        if placement is None and not frames.is_settled(claim):
            raise _Open(claim)
        return placement or frames.place(claim)

    try:
        return process(recording, conditions, models.of, placed)
    except _Open as claim:
        return claim
    except Exception as error:
        return _failed(recording, error)


def _stored(processed: Processed, database: TerrainDatabase | str | Path) -> Outcome:
    """Store what was made of a recording; it fails alone where another program gave its site an origin meanwhile."""
    try:
        return store(processed, database)
    except OriginsDiffer as error:
        return FailedRecording(str(processed.about["source"]), str(error))


def _failed(recording: Recording | Path, error: BaseException) -> FailedRecording:
    """Say in one line that names the recording why it failed; where it is a defect of the program also in what line."""
    source = str(recording.source if isinstance(recording, Recording) else recording)
    text = " ".join(str(error).split())
    if not isinstance(error, BevameterError):
        frames = traceback.extract_tb(error.__traceback__)
        place = f", {Path(frames[-1].filename).name} line {frames[-1].lineno}" if frames else ""
        text = f"{type(error).__name__}: {text:.300}{place}"
    return FailedRecording(source, text if text.startswith(source) else f"{source}: {text}")
