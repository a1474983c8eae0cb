"""Where recordings are processed: in processes of this machine, or on a Dask cluster.

Both are handed functions and plain data, and give futures of `concurrent.futures`.
"""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from .core.errors import BevameterError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from distributed import Client
    from loky import ProcessPoolExecutor

CONNECT_S = 10.0
"""How long the scheduler of a cluster is waited for [s]."""

_THREAD_VARIABLES = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)  # fmt: skip
"""Environment variables by which libraries choose their number of threads as they are loaded."""


class WorkerLost(BevameterError):
    """The process that worked ended before it was done, or cannot be reached any more."""


class Workers(Protocol):
    """What processes of this machine and a cluster have in common; leaving the context ends all work."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a function called; it and its arguments must be such as can be sent to another process."""
        ...

    def shared(self, value: Any) -> Any:
        """Give what stands for a value among the arguments of many calls, so that it need not be sent with each."""
        ...

    def __enter__(self) -> Workers: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class LocalWorkers:
    """Processes of this machine, each on its share of the cores; one that dies takes nothing with it but its own call.

    Each thread here has one process, started with its first call and again after it died. The processes end with this
    one, however it ends: each holds the reading end of a pipe that nobody else writes to.

    Parameters
    ----------
    count
        How many there are.
    """

    def __init__(self, count: int):
        from loky import cpu_count

        share = str(max(cpu_count() // count, 1))
        self._environment = {name: os.environ.get(name, share) for name in _THREAD_VARIABLES}
        self._read, self._write = Pipe(duplex=False)
        self._lock = threading.Lock()
        self._processes: dict[int, ProcessPoolExecutor] = {}
        self._threads = ThreadPoolExecutor(count, initializer=_leave_interrupts)
        _start_tracker()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a function called; the future raises `WorkerLost` where its process died."""
        return self._threads.submit(self._call, function, *arguments)

    def shared(self, value: Any) -> Any:
        """Give the value itself: it is sent through a pipe."""
        return value

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        process = self._own_process()
        try:
            return process.submit(function, *arguments).result()
        except BrokenExecutor as error:
            with self._lock:
                del self._processes[threading.get_ident()]
            text = "its worker process died before it was done, as one that is killed or runs out of memory does"
            raise WorkerLost(text) from error

    def _own_process(self) -> ProcessPoolExecutor:
        from loky import ProcessPoolExecutor

        with self._lock:
            # A pool of one process each: of a larger one the death of one process ends the others' calls, too.
            return self._processes.setdefault(
                threading.get_ident(),
                ProcessPoolExecutor(1, env=self._environment, initializer=_end_with, initargs=(self._read,)),
            )

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._write.close()
        self._threads.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            processes = list(self._processes.values())
        for process in processes:
            process.shutdown(kill_workers=True)
        self._threads.shutdown()
        self._read.close()


def _start_tracker() -> None:
    """Start the process that removes what killed workers leave behind, without its warnings of what it removes."""
    from loky.backend.resource_tracker import ensure_running

    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = "ignore"
    try:
        ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


def _leave_interrupts() -> None:
    """Leave Ctrl-C to the main thread, in this process and in those that this thread starts."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


def _end_with(parent: Connection) -> None:
    """End this process as soon as nobody can write to the pipe any more, whatever it is doing."""

    def watch() -> None:
        try:
            parent.recv_bytes()
        except (EOFError, OSError):
            os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where signals cannot be blocked: Windows
    threading.Thread(target=watch, daemon=True).start()


class ClusterWorkers:
    """A Dask cluster, whose workers have the same version of Bevameter and see the same files.

    Parameters
    ----------
    client
        Connected to its scheduler. It stays open.
    """

    def __init__(self, client: Client):
        self._client = client
        self._executor = client.get_executor(pure=False)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a function called by a worker that is free; a Dask future among its arguments stands for its value."""
        return self._executor.submit(function, *arguments)

    def shared(self, value: Any) -> Any:
        """Send the value once, as the result of a task, which the cluster makes again where it is lost."""
        return self._client.submit(_itself, value, pure=False)

    def __enter__(self) -> ClusterWorkers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(wait=False)


def _itself(value: Any) -> Any:
    return value


def connect(address: str) -> Client:
    """Connect to the scheduler of a Dask cluster.

    Parameters
    ----------
    address
        Such as ``"tcp://10.0.0.1:8786"``.

    Raises
    ------
    InputError
        Dask is not installed, or no scheduler answers within `CONNECT_S`.
    """
    try:
        distributed = import_module("distributed")
        comm = import_module("distributed.comm")
    except ImportError as error:
        raise InputError("distributed", "is not installed", expected='pip install "bevameter[fleet]"') from error
    try:
        comm.resolve_address(address)  # a client whose address is none takes long to give up, and not quietly
        return distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        what = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        expected = "the address of a Dask scheduler, such as tcp://10.0.0.1:8786"
        raise InputError(f"Dask scheduler {address!r}", what, expected=expected) from error
