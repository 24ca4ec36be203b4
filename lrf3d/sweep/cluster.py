"""Dask clusters: processes on this machine, or a scheduler that the user has started.

Without an address, processes with one thread each are started on this machine, one for each core;
with the address of a scheduler its workers are used. lrf3d itself listens only on 127.0.0.1, and
there is no dashboard.
"""

import hashlib
import logging
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from lrf3d.cores import core_count
from lrf3d.errors import InputError, Lrf3dError, MissingLibraryError, missing_extra
from lrf3d.interrupts import uninterrupted
from lrf3d.output import scratch_folder


def missing_sweep() -> MissingLibraryError:
    """The error that explains how to install Dask and Parquet."""
    return missing_extra("sweeps need Dask and Parquet", "sweep")


try:
    import dask
    import distributed.core
    from distributed import Client, LocalCluster, Nanny
    from distributed.utils import silence_logging_cmgr
except ImportError as error:
    raise missing_sweep() from error

ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s/]+:\d+/?")
"""Addresses of schedulers."""

SCHEDULER_SECONDS = 30.0
"""Time to wait for a scheduler and its first worker [s]."""

MOST_KILLED_WORKERS = 20
"""Largest number of workers that one task may lose: a machine short of memory kills some by chance,
but a task that makes every worker crash must not be repeated forever."""


KILLED_SECONDS = 60.0
"""Time that a killed process may take to go [s]: Dask's 5 s are too few on a machine that has many
other processes, and a sweep that was finished would end with an error."""


class PatientNanny(Nanny):  # type: ignore[misc]
    """Starts and ends a process for the work, and waits until it is gone."""

    async def kill(self, timeout: float = 5.0, reason: str = "nanny-kill") -> None:
        """End the process: it is asked to end, and killed after a time [s]."""
        try:
            await super().kill(timeout, reason)
        except TimeoutError:
            if self.process is not None and self.process.process is not None:
                await self.process.process.join(KILLED_SECONDS)


def check_address(address: str) -> None:
    """Check the address of a scheduler, before anything else is done.

    Raises:
        InputError: It is invalid.
    """
    if not ADDRESS.fullmatch(address):
        raise InputError(f"--scheduler {address}: expected an address such as tcp://127.0.0.1:8786")


@contextmanager
def connected(scheduler: str | None, workers: int | None = None) -> Iterator[Client]:
    """A client of a scheduler, or of processes on this machine that end with it.

    Args:
        scheduler: Address of the scheduler, as ``tcp://HOST:PORT``; None for this machine.
        workers: Processes on this machine; one a core where None.

    Raises:
        InputError: There is no such scheduler, it has no workers, or they cannot use this lrf3d.
    """
    if scheduler is not None:
        with _remote(scheduler) as client:
            yield client
        return
    settings = {
        "distributed.scheduler.allowed-failures": MOST_KILLED_WORKERS,
        # Results are small, so other programs use the memory if workers are short of it.
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": False,
    }
    with (
        scratch_folder() as folder,
        dask.config.set({**settings, "temporary-directory": str(folder)}),
        ExitStack() as started,
    ):
        # A terminal sends Ctrl-C to all processes; only this one is to handle it.
        with uninterrupted():
            client = started.enter_context(_started(core_count() if workers is None else workers))
        yield client


@contextmanager
def _started(workers: int) -> Iterator[Client]:
    """A client of new processes on this machine.

    Raises:
        Lrf3dError: They cannot be started.
    """
    with ExitStack() as started:
        started.callback(_forget_clusters)
        try:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # Port 0 is any free one; otherwise two sweeps would claim the same.
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                worker_dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
                worker_class=PatientNanny,
            )
            client = started.enter_context(Client(started.enter_context(cluster)))
        except Exception as error:
            # What is raised depends on what is lacking: memory, processes, ports, room for files.
            reason = " ".join(str(error).split()) or type(error).__name__
            raise Lrf3dError(
                f"{workers} processes for the work cannot be started: {reason}; try fewer with"
                " --workers, or give --scheduler"
            ) from error
        yield client


def _forget_clusters() -> None:
    """Let go of clusters that have ended.

    Dask remembers every method that a scheduler ever served, and with it the scheduler: a process
    that makes one sweep after the other would keep 0.2 MB of each.
    """
    remembered = getattr(distributed.core, "_expects_comm", None)
    forget = getattr(remembered, "cache_clear", None)
    if forget is not None:
        forget()


@contextmanager
def _remote(address: str) -> Iterator[Client]:
    try:
        client = Client(address, timeout=SCHEDULER_SECONDS)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: no scheduler answers there; start one with dask scheduler,"
            " and give the tcp:// address that it prints"
        ) from error
    # lrf3d reports a lost scheduler itself, in one line.
    with client, silence_logging_cmgr(logging.CRITICAL):
        try:
            client.wait_for_workers(1, timeout=SCHEDULER_SECONDS)
        except TimeoutError as error:
            raise InputError(
                f"--scheduler {address}: it has no workers; start some with dask worker {address}"
            ) from error
        _check_code(client, address)
        yield client


def _check_code(client: Client, address: str) -> None:
    """Check that the workers have this version of lrf3d; another could give other results."""
    try:
        found: dict[str, str] = client.run(code_digest)
    except Exception as error:
        raise InputError(
            f"--scheduler {address}: its workers cannot import lrf3d; install it there"
        ) from error
    ours = code_digest()
    others = [worker for worker, theirs in found.items() if theirs != ours]
    if others:
        raise InputError(
            f"--scheduler {address}: worker {others[0]} has another version of lrf3d; install"
            " there what is installed here"
        )


def code_digest() -> str:
    """A digest of the source of lrf3d on this machine."""
    package = Path(__file__).parents[1]
    total = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        total.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def hold(client: Any, make: Callable[[bytes], Any], packed: bytes, *, key: str) -> Any:
    """An object on the cluster, made from packed data, as an argument for tasks.

    It is the result of a task instead of scattered data: if the last worker that holds it dies, it
    is made again.

    Args:
        client: The client of the cluster.
        make: Makes the object from the packed data, on a worker.
        packed: The data, which the scheduler keeps.
        key: Its name on the cluster.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        return client.submit(make, packed, key=key)
