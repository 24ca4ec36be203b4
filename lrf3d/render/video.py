"""Films and pictures of a run, drawn with pyrender and encoded as H.264."""

import math
import os
import pickle
import selectors
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.errors import InputError
from lrf3d.output import replacing
from lrf3d.render.gl import require_gl
from lrf3d.render.timeline import Timeline
from lrf3d.render.worker import Job
from lrf3d.simulation import Run
from lrf3d.world.cameras import MOVING_VIEWS, check_view

Progress = Callable[[int, int], None]
"""Called with the number of frames done and the number of all."""

VIEWS = MOVING_VIEWS
"""Names of the cameras that every world has."""

SAMPLES = (0, 4)
"""Samples a pixel that can be asked for."""

_FRAMES_A_WORKER = 20
"""A process that draws fewer frames than this takes longer to start than it saves."""

_SMALLEST, _LARGEST = 16, 8192
"""Sides of pictures [pixels] that can be drawn."""


def render_video(
    run: Run,
    path: str | Path,
    *,
    size: tuple[int, int] = (1280, 720),
    fps: float = 25.0,
    playback: float = 1.0,
    view: str = "chase",
    samples: int = 4,
    workers: int | None = None,
    progress: Progress | None = None,
) -> None:
    """Draw a run as a film, H.264 in mp4.

    Args:
        run: The run.
        path: The file to write; it appears whole or not at all.
        size: Width and height [pixels], both even.
        fps: Frames a second.
        playback: Seconds of the run in a second of the film.
        view: Name of the camera: ``chase``, ``first``, ``orbit``, ``top``, or one of the world's.
        samples: Samples a pixel against jagged edges: 4, or 0 for none.
        workers: Number of processes; as many as there are cores where not given.
        progress: Called with frames done and frames in all, as the film grows.

    Raises:
        InputError: An argument is out of its range.
        MissingLibraryError: There is no OpenGL on this machine.
        OutputError: The file cannot be written.
    """
    _check(run, size, view, samples)
    if size[0] % 2 or size[1] % 2:
        raise InputError(f"size {size[0]}x{size[1]}: H.264 needs even numbers")
    if not (fps > 0.0 and math.isfinite(fps) and playback > 0.0 and math.isfinite(playback)):
        raise InputError(f"fps {fps:g} and playback {playback:g}: expected more than 0")
    if workers is not None and workers < 1:
        raise InputError(f"workers {workers}: expected at least 1")
    require_gl()
    times = Timeline(run, playback=playback).frame_times(fps)
    job = Job(run, times, size, fps, playback, view, samples)
    with replacing(path) as unfinished, tempfile.TemporaryDirectory(prefix="lrf3d-") as folder:
        # A folder that cannot be written to is better known before the film is drawn.
        unfinished.touch()
        unfinished.unlink()
        parts, frames = _draw_parts(job, Path(folder), workers, progress)
        from lrf3d.render.encoder import join

        join(parts, frames, unfinished)


def frame(
    run: Run,
    time: float,
    *,
    size: tuple[int, int] = (1280, 720),
    view: str = "chase",
    samples: int = 4,
    playback: float = 1.0,
) -> NDArray[np.uint8]:
    """Draw a run at a time [s] as one picture, as it is in the film of that playback.

    Returns:
        The picture (h, w, 3) uint8: red, green, blue, row 0 at the top.

    Raises:
        InputError: An argument is out of its range.
        MissingLibraryError: There is no OpenGL on this machine.
    """
    _check(run, size, view, samples)
    if not (math.isfinite(time) and math.isfinite(playback) and playback > 0.0):
        raise InputError(f"time {time} and playback {playback}: expected finite numbers of seconds")
    require_gl()
    return np.array(_film(run, size, view, samples, playback).draw(time)[:, :, :3])


@lru_cache(maxsize=1)
def _film(run: Run, size: tuple[int, int], view: str, samples: int, playback: float) -> Any:
    """The film of the pictures asked for last: setting one up costs as much as forty pictures."""
    from lrf3d.render.film import Film

    return Film(run, size=size, view=view, samples=samples, playback=playback)


def _check(run: Run, size: tuple[int, int], view: str, samples: int) -> None:
    if not all(_SMALLEST <= side <= _LARGEST for side in size):
        raise InputError(
            f"size {size[0]}x{size[1]}: expected {_SMALLEST} to {_LARGEST} pixels a side"
        )
    check_view(view, run.world.cameras)
    if samples not in SAMPLES:
        raise InputError(f"samples {samples}: expected 0 or 4")


def _draw_parts(
    job: Job, folder: Path, workers: int | None, progress: Progress | None
) -> tuple[list[Path], list[int]]:
    """Draw the film in parts, one process each; gives the files and how long each is [frames]."""
    total = len(job.times)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    cores = cores or 1
    count = workers or min(cores, math.ceil(total / _FRAMES_A_WORKER))
    bounds = np.linspace(0, total, min(count, total) + 1).round().astype(int).tolist()
    job_file = folder / "job.pickle"
    job_file.write_bytes(pickle.dumps(job, pickle.HIGHEST_PROTOCOL))
    ranges = list(pairwise(bounds))
    parts = [folder / f"part{number:03d}.mp4" for number in range(len(ranges))]
    threads = max(1, cores // len(ranges))
    processes: list[subprocess.Popen[bytes]] = []
    try:
        for (first, last), part in zip(ranges, parts, strict=True):
            processes.append(_start(job_file, first, last, part, threads))
        _follow(processes, total, progress)
        for process, part in zip(processes, parts, strict=True):
            if process.wait() != 0:
                raise _failure(process.returncode, part)
    finally:
        for process in processes:
            process.kill()
            process.wait()
            assert process.stdout is not None
            process.stdout.close()
    return parts, [last - first for first, last in ranges]


def _start(
    job_file: Path, first: int, last: int, part: Path, threads: int
) -> "subprocess.Popen[bytes]":
    """Start a process that draws the frames from first to before last."""
    environment = {
        **os.environ,
        # Read by Mesa's software OpenGL: more threads than cores only wait for each other.
        "LP_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    command = [sys.executable, "-m", "lrf3d.render.worker"]
    with part.with_suffix(".log").open("wb") as log:
        return subprocess.Popen(
            [*command, str(job_file), str(first), str(last), str(part)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            env=environment,
            # An interrupt is for the caller, who then ends these.
            start_new_session=True,
        )


def _follow(
    processes: "list[subprocess.Popen[bytes]]", total: int, progress: Progress | None
) -> None:
    """Count frames until all processes have ended, or until one has failed."""
    done = 0
    with selectors.DefaultSelector() as selector:
        for process in processes:
            selector.register(process.stdout, selectors.EVENT_READ, process)  # type: ignore[arg-type]
        while selector.get_map():
            for key, _ in selector.select():
                read = os.read(key.fd, 4096)
                if not read:
                    selector.unregister(key.fileobj)
                    if key.data.wait() != 0:
                        return
                done += len(read)
            if progress is not None:
                progress(done, total)


def _failure(status: int, part: Path) -> Exception:
    """What ended a process: the error that it left, or the end of what it printed."""
    left = part.with_suffix(".error")
    if left.exists():
        error = pickle.loads(left.read_bytes())
        assert isinstance(error, Exception)
        return error
    log = part.with_suffix(".log").read_text(errors="replace").strip()
    return RuntimeError(f"drawing a part of the film failed with status {status}:\n{log[-3000:]}")
