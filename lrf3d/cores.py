"""How many cores work may be shared over, and processes that share it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from lrf3d.interrupts import whole

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor


def core_count() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def process_pool(processes: int) -> Iterator["ProcessPoolExecutor"]:
    """Fresh processes that end with the block: where it ends early, whatever they are doing.

    They are no forks, which could inherit a lock that a thread of Embree or numba holds just then.
    An interrupt is left to the process that they work for, and they end when it is gone.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import active_children, get_context

    others = active_children()
    pool = ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=_serve)
    try:
        with whole():
            # A process is started for each task that finds none that is free.
            for _ in range(processes):
                pool.submit(os.getpid)
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in active_children():
            if process not in others:
                process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _serve() -> None:
    """End this process when the one that it works for is gone."""
    import multiprocessing
    from threading import Thread

    caller = multiprocessing.parent_process()
    assert caller is not None
    Thread(target=_end_with, args=(caller.sentinel,), daemon=True).start()


def _end_with(caller: int) -> None:
    from multiprocessing.connection import wait

    wait([caller])
    os._exit(1)
