"""A film's parts, drawn and encoded by the workers of a Dask cluster.

The job is sent once, and each part comes back as the bytes of its files. A worker starts a process
for a part, as this machine does for its own films: an OpenGL context belongs to a process. A part
whose worker dies is given to another.
"""

import os
import pickle
import queue
import selectors
import subprocess
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lrf3d.cluster.connection import connected
from lrf3d.cluster.holding import hold
from lrf3d.errors import InputError, Lrf3dError
from lrf3d.output import scratch_folder
from lrf3d.render.drawer import end_drawer, failure_of, start_drawer
from lrf3d.render.film_parts import Progress, part_name, split_frames
from lrf3d.render.worker import Job

_RETRIES = 3
"""How often a part is drawn again where its process was killed, as those short of memory are."""

_TOLD_SECONDS = 0.25
"""How often a worker reports how many frames are done [s]."""

_WATCH_SECONDS = 1.0
"""How often a worker looks whether its part is still asked for [s]."""

Files = dict[str, bytes]
"""The files of a part: what each holds, by its path."""


def draw_parts_on(
    scheduler: str, job: Job, folder: Path, workers: int | None, progress: Progress | None
) -> tuple[list[Path], list[int]]:
    """Draw the film in parts on a cluster; gives the files and how long each is [frames].

    Args:
        scheduler: Address of the scheduler.
        job: What to draw.
        folder: Where the parts are put.
        workers: How many parts; as many as the cluster draws at once where None.
        progress: Called with the frames done and all; where a worker died, fewer are done again.

    Raises:
        InputError: The scheduler cannot be used, or a part kills the workers it is given to.
        MissingLibraryError: A worker cannot draw with the renderer.
        Lrf3dError: The connection is lost.
    """
    from distributed import CancelledError, KilledWorker

    total = len(job.times)
    with connected(scheduler) as client:
        ranges = split_frames(total, workers, at_once=sum(client.nthreads().values()))
        name = f"lrf3d-film-{uuid.uuid4().hex}"
        heard: queue.SimpleQueue[Any] = queue.SimpleQueue()
        client.subscribe_topic(name, lambda event: heard.put(event[1]))
        packed = pickle.dumps(job, pickle.HIGHEST_PROTOCOL)
        held = hold(client, _same, packed, key=name)
        futures = [
            client.submit(
                draw_there, held, number, bounds, name, key=f"{name}-{number}", retries=_RETRIES
            )
            for number, bounds in enumerate(ranges)
        ]
        for future in futures:
            future.add_done_callback(heard.put)
        try:
            _collect(heard, futures, folder, total, progress)
        except KilledWorker as error:
            raise InputError(
                "parts of the film kill the workers that they are given to; give these more"
                " memory, or draw more and shorter parts with --workers"
            ) from error
        except CancelledError as error:
            raise Lrf3dError(
                "the connection to the scheduler is lost; draw the film again when it is back"
            ) from error
    parts = [folder / part_name(number) for number in range(len(ranges))]
    return parts, [last - first for first, last in ranges]


def _collect(
    heard: "queue.SimpleQueue[Any]",
    futures: list[Any],
    folder: Path,
    total: int,
    progress: Progress | None,
) -> None:
    """Write parts as they come and report how many frames are done, until all are there."""
    done = [0] * len(futures)
    waiting = set(futures)
    while waiting:
        news = heard.get()
        if isinstance(news, tuple):
            number, frames = news
            done[number] = frames
        else:
            waiting.discard(news)
            found = news.result()
            if isinstance(found, Lrf3dError):
                raise found
            for name, content in found.items():
                path = folder / name
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(content)
            # The cluster need not hold them any longer.
            news.release()
        if progress is not None:
            progress(sum(done), total)


def _same(packed: bytes) -> bytes:
    return packed


def draw_there(job: bytes, number: int, bounds: tuple[int, int], topic: str) -> Files | Lrf3dError:
    """Draw a part of a film on the worker that this is called on.

    Args:
        job: The job, pickled.
        number: The number of the part.
        bounds: Its first frame, and the one after its last.
        topic: The topic of Dask under which it reports how many frames are done.

    Returns:
        The files of the part. A known error is given back and not raised: it would come again,
        so that another try is no use.
    """
    from distributed import get_worker

    worker = get_worker()
    with scratch_folder() as folder:
        part = folder / part_name(number)
        job_file = folder / "job.pickle"
        job_file.write_bytes(job)
        # As many parts as a worker has threads come to it at once.
        process = start_drawer(job_file, *bounds, part, threads=1)
        try:
            _follow(
                process,
                lambda frames: worker.log_event(topic, (number, frames)),
                wanted=_wanted(worker),
            )
            if process.wait() != 0:
                error = failure_of(process.returncode, part)
                if isinstance(error, Lrf3dError):
                    return error
                raise error
        finally:
            end_drawer(process)
        files = part.rglob("*") if part.is_dir() else [part]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _follow(
    process: "subprocess.Popen[bytes]", tell: Callable[[int], None], *, wanted: Callable[[], bool]
) -> None:
    """Report how many frames are done until the process ends; end it if nobody needs them."""
    assert process.stdout is not None
    done, told = 0, time.monotonic()
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while True:
            if selector.select(_WATCH_SECONDS):
                read = os.read(process.stdout.fileno(), 4096)
                done += len(read)
                if not read or time.monotonic() > told + _TOLD_SECONDS:
                    tell(done)
                    told = time.monotonic()
                if not read:
                    return
            if not wanted():
                process.kill()


def _wanted(worker: Any) -> Callable[[], bool]:
    """Whether the task that this is called in is still asked for.

    Dask only forgets what a client that is gone has asked for; it ends nothing that has begun.
    """
    key = worker.get_current_task()

    def asked() -> bool:
        task = worker.state.tasks.get(key)
        return task is not None and task.state != "cancelled"

    return asked
