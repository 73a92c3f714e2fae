"""Where jobs run: any :class:`concurrent.futures.Executor`.

``processes[:N]``, ``dask``, ``dask:ADDRESS`` and ``mpi`` by name; to :func:`~.run.run` every other
one is as good.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from .._core import Error
from .._readers.packages import install_command

CHOICES = ("processes", "processes:N", "dask", "dask:ADDRESS", "mpi")


@dataclass(frozen=True)
class Workers:
    """An executor, and how much to give it at once."""

    executor: Executor
    count: int
    """That work side by side."""
    ahead: int
    """Jobs to submit beyond those that are being worked on: 0 keeps the order of importance."""


class SeparateProcesses(Executor):
    """Processes of which one that dies takes nothing but its own job with it.

    A :class:`ProcessPoolExecutor` whose process dies breaks as a whole, and does not say which
    job it was. Here every process is a pool of its own, made anew when it breaks. Processes are
    spawned, ignore Ctrl-C, and end with the one that started them, however that ends.
    """

    def __init__(self, count: int) -> None:
        self._lock = threading.RLock()  # a job may be done before anyone waits for it
        self._waiting: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self._workers = [_Worker() for _ in range(count)]
        self._idle = list(self._workers)
        self._closed = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a process call ``fn``; it must be importable there."""
        future: Future[Any] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("SeparateProcesses: submit: it was shut down")
            self._waiting.append((future, lambda: (fn, args, kwargs)))
        self._dispatch()
        return future

    def _dispatch(self) -> None:
        with self._lock:
            while self._idle and self._waiting and not self._closed:
                future, call = self._waiting.popleft()
                if not future.set_running_or_notify_cancel():
                    continue
                worker = self._idle.pop()
                fn, args, kwargs = call()
                try:
                    inner = worker.submit(fn, *args, **kwargs)
                except Exception as error:  # no process: who waits must hear of it
                    worker.broken = True
                    self._idle.append(worker)
                    future.set_exception(error)
                    continue
                inner.add_done_callback(partial(self._done, future=future, worker=worker))

    def _done(self, inner: Future[Any], future: Future[Any], worker: _Worker) -> None:
        error = CancelledInside() if inner.cancelled() else inner.exception()
        if isinstance(error, BrokenExecutor):
            worker.broken = True
        with self._lock:
            self._idle.append(worker)
        if error is None:
            future.set_result(inner.result())
        else:
            future.set_exception(error)
        self._dispatch()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; with ``cancel_futures`` at once, whatever they are doing."""
        with self._lock:
            self._closed = True
            left = [future for future, _ in self._waiting]
            self._waiting.clear()
        for future in left:
            future.cancel()
        for worker in self._workers:
            worker.end(wait=wait, now=cancel_futures)


class CancelledInside(BrokenExecutor):
    """A process was ended before its job was."""


class _Worker:
    """One process, made when it is needed."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._lifeline: Connection | None = None
        self.broken = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self._pool is not None and not self.broken:
            try:
                return self._pool.submit(fn, *args, **kwargs)
            except BrokenExecutor:  # it died while it had nothing to do
                pass
        self.end(wait=False, now=True)
        context = multiprocessing.get_context("spawn")
        theirs, self._lifeline = context.Pipe(duplex=False)
        self._pool = ProcessPoolExecutor(
            1, mp_context=context, initializer=_live_with_parent, initargs=(theirs,)
        )
        self.broken = False
        return self._pool.submit(fn, *args, **kwargs)

    def end(self, *, wait: bool, now: bool) -> None:
        if now and self._lifeline is not None:
            self._lifeline.close()
        if self._pool is not None:
            self._pool.shutdown(wait=wait, cancel_futures=now)
        if self._lifeline is not None:
            self._lifeline.close()
        self._pool = self._lifeline = None


def _live_with_parent(lifeline: Connection) -> None:
    """Leave Ctrl-C to the parent, and end when its side of the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        try:
            lifeline.recv_bytes()
        except (EOFError, OSError):
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def workers(name: str) -> Iterator[Workers]:
    """Yield what a name on the command line means; end it afterwards, at once after an error."""
    kind, _, rest = name.partition(":")
    if kind == "processes":
        opened = _processes(rest)
    elif kind == "dask":
        opened = _dask(rest)
    elif name == "mpi":
        opened = _mpi()
    else:
        raise Error(f"--executor: got {name!r}; choices: {', '.join(CHOICES)}")
    with opened as found:
        yield found


@contextmanager
def _processes(count: str) -> Iterator[Workers]:
    if count and (not count.isdecimal() or int(count) < 1):
        raise Error(f"--executor: processes: got {count!r}, expected a number from 1 on")
    number = int(count) if count else len(os.sched_getaffinity(0))
    executor = SeparateProcesses(number)
    try:
        yield Workers(executor, number, 0)
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        raise
    executor.shutdown()


@contextmanager
def _dask(address: str) -> Iterator[Workers]:
    try:
        from distributed import Client, LocalCluster
        from distributed.comm import get_address_host_port
    except ImportError as error:
        raise Error(
            f"--executor: dask is not installed; install it with: {install_command('dask')}"
        ) from error
    import dask

    with ExitStack() as opened:
        # A worker that dies is told of the first time; `run` decides who gets a second chance.
        opened.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
        try:
            # A Client that cannot read its address is left half made, and locks the next one.
            if address:
                get_address_host_port(address)
            cluster = address or opened.enter_context(
                LocalCluster(threads_per_worker=1, dashboard_address=None)
            )
            client = opened.enter_context(Client(cluster))
        except (OSError, ValueError) as error:
            raise Error(f"--executor: {address or 'a LocalCluster'}: {error}") from error
        threads = sum(client.nthreads().values())
        # A cluster grows while it works: enough to keep all of it busy.
        yield Workers(client.get_executor(pure=False), max(1, threads), max(64, threads))


@contextmanager
def _mpi() -> Iterator[Workers]:
    try:
        from mpi4py.futures import MPIPoolExecutor
    except ImportError as error:
        raise Error(
            "--executor: mpi4py is not installed, or finds no MPI; install both, and start with:"
            " mpiexec -n N python -m mpi4py.futures -m diffnea.reproduce …"
        ) from error
    with MPIPoolExecutor() as executor:
        count = max(1, executor.num_workers)
        yield Workers(executor, count, count)
