"""Clusters: processes on this machine, or a scheduler that the user has started, by Dask.

Without an address, processes on this machine are started, one a core with one thread each; with
the address of a scheduler its workers are used. Nothing listens beyond 127.0.0.1 but what the
user has started, and there is no dashboard.
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
from lrf3d.errors import InputError, Lrf3dError, MissingLibraryError
from lrf3d.interrupts import whole
from lrf3d.output import scratch_folder


def missing_sweep() -> MissingLibraryError:
    """The error that says how to get Dask and Parquet."""
    return MissingLibraryError("sweeps need Dask and Parquet; pip install 'lrf3d[sweep]'")


try:
    import dask
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr
except ImportError as error:
    raise missing_sweep() from error

ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s/]+:\d+/?")
"""Addresses of schedulers."""

SCHEDULER_SECONDS = 30.0
"""How long to wait for a scheduler and its first worker [s]."""

LIVES = 20
"""Workers that may die of one task: a machine that is short of memory kills many by chance, but a
task that kills each of its workers must not go round for ever."""


def check_address(address: str) -> None:
    """See that an address is one of a scheduler, before anything else is done.

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
        "distributed.scheduler.allowed-failures": LIVES,
        # Results are small, so that workers short of memory are so for another's sake.
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": False,
    }
    with (
        scratch_folder() as folder,
        dask.config.set({**settings, "temporary-directory": str(folder)}),
        ExitStack() as started,
    ):
        # Ctrl-C is for the one that talks to the user: a terminal sends it to all processes.
        with whole():
            client = started.enter_context(_started(core_count() if workers is None else workers))
        yield client


@contextmanager
def _started(workers: int) -> Iterator[Client]:
    """A client of new processes on this machine.

    Raises:
        Lrf3dError: They cannot be started.
    """
    with ExitStack() as started:
        try:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # Port 0 is any that is free; without it two sweeps would want the same.
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                worker_dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
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


@contextmanager
def _remote(address: str) -> Iterator[Client]:
    try:
        client = Client(address, timeout=SCHEDULER_SECONDS)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: no scheduler answers there; start one with dask scheduler,"
            " and give the tcp:// address that it prints"
        ) from error
    # A lost scheduler is reported by lrf3d itself, in one line.
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
    """See that the workers have just this lrf3d: another could give other figures."""
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
    """A digest of the source of lrf3d as it lies on this machine."""
    package = Path(__file__).parents[1]
    total = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        total.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def hold(client: Any, make: Callable[[bytes], Any], packed: bytes, *, key: str) -> Any:
    """What is made of packed data, on the cluster, as an argument for tasks.

    It is the result of a task and no data that was handed around: when the last worker that held
    it has died, it is made again.

    Args:
        client: The client of the cluster.
        make: Makes it of the packed data, on a worker.
        packed: The data, which the scheduler keeps.
        key: Its name on the cluster.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        return client.submit(make, packed, key=key)
