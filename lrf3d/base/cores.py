"""The number of available cores, and pools of threads and of processes."""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from lrf3d.base.errors import OutputError
from lrf3d.base.interrupts import MOMENT, check

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

Result = TypeVar("Result")


def core_count() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def process_pool(processes: int) -> Iterator["ProcessPoolExecutor"]:
    """New processes that end with the block; if it ends early, they are killed.

    They are not forked, because a fork could inherit a lock that a thread of Embree or numba holds.
    They block Ctrl-C, which a terminal sends to all of them, and end when their parent has ended.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import active_children, get_context, resource_tracker

    others = active_children()
    # The locks of a program that is ended at once are removed by their tracker: that is no warning.
    sys.warnoptions += {"ignore:resource_tracker"} - {*sys.warnoptions}
    try:
        pool = ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=_watch)
    except OSError as error:
        # Its locks are files in memory, of which containers have 64 MB.
        raise OutputError(
            f"/dev/shm: {error.strerror}, and processes that work side by side need some; make room"
            " there, or use one process: --workers 1"
        ) from error
    try:
        # A process is started for each task for which none is idle, and inherits what is blocked.
        # The resource tracker, which Python starts with the first process, would unblock it.
        if posix := hasattr(signal, "pthread_sigmask"):
            resource_tracker.ensure_running()
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            for _ in range(processes):
                pool.submit(os.getpid)
        finally:
            if posix:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        yield pool
    except BaseException:
        # Futures are not cancelled: the pool reports its end to all of them, and raises in a thread
        # of its own if one is cancelled already.
        for process in active_children():
            if process not in others:
                process.kill()
        raise
    finally:
        pool.shutdown()


def results(futures: "Iterable[Future[Result]]") -> "Iterator[Result]":
    """The results of futures in their order; a signal may stop the wait for one."""
    from concurrent.futures import wait

    for future in futures:
        # A signal does not end this wait, so it ends now and then by itself.
        while not wait([future], MOMENT).done:
            check()
        yield future.result()


def _watch() -> None:
    """End this process when its parent has ended."""
    import multiprocessing
    from multiprocessing.connection import wait
    from threading import Thread

    caller = multiprocessing.parent_process()
    assert caller is not None

    def end(sentinel: int) -> None:
        wait([sentinel])
        os._exit(1)

    Thread(target=end, args=(caller.sentinel,), daemon=True).start()


def share(work: Callable[[int, int], None], count: int, least: int = 8) -> None:
    """Call work(start, stop) for pieces of range(count), in one thread for each core.

    No piece but the last is smaller than the least that is worth a thread.
    """
    # Asking for the cores takes as long as a few scans.
    cores = core_count() if count > least else 1
    # With fewer pieces a core the slowest core decides, with more Python's lock does.
    size = max(least, -(-count // (8 * cores)))
    if count <= size or cores < 2:
        work(0, count)
        return
    # An empty piece compiles or builds what all threads need.
    work(0, 0)
    starts = range(0, count, size)
    for _ in _pool(cores).map(work, starts, (min(start + size, count) for start in starts)):
        pass


@cache
def _pool(threads: int) -> "ThreadPoolExecutor":
    """Threads that are kept: starting new ones for each batch would cost a sixth of its time."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads, thread_name_prefix="lrf3d")


if hasattr(os, "register_at_fork"):  # pragma: no branch - Windows has no fork
    # The threads of its parent do not exist in a forked process.
    os.register_at_fork(after_in_child=_pool.cache_clear)
