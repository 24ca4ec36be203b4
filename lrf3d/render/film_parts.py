"""A film's parts, drawn and encoded at the same time by processes of this machine.

In goes a job; a file or a folder for each part leaves. A process draws one part:
``python -m lrf3d.render.film_parts JOB FIRST LAST PART``. It writes a byte to its standard output
for each frame that is done.
"""

import math
import os
import pickle
import selectors
import shutil
import subprocess
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from lrf3d.cores import core_count
from lrf3d.errors import Lrf3dError
from lrf3d.geometry import Float
from lrf3d.interrupts import check
from lrf3d.render.pictures import FrameProgress
from lrf3d.run import Run
from lrf3d.scene.stage import Stage

FRAME_DONE = b"."

FRAMES = ".png"
"""The ending of a job whose parts are folders of single frames."""


@dataclass(frozen=True, slots=True)
class Job:
    """A film to draw.

    Args:
        run: The run.
        times: Times (frames,) of the run [s], one for each frame.
        size: Width and height [pixels].
        fps: Frames a second.
        playback: Seconds of the run in a second of the film.
        view: Name of the camera.
        samples: Samples a pixel, 0 or 4.
        renderer: Name of the renderer.
        ending: Ending of the film's file, which says how parts are encoded.
        stage: What stands in the run's world: its light is baked once for all parts.
    """

    run: Run
    times: Float
    size: tuple[int, int]
    fps: float
    playback: float
    view: str
    samples: int
    renderer: str
    ending: str
    stage: Stage


def draw_part(job: Job, first: int, last: int, part: Path) -> None:
    """Draw the frames from first to before last into a file, and say so on standard output."""
    from lrf3d.render.film import Film
    from lrf3d.render.formats import FORMATS
    from lrf3d.render.pictures import PngEncoder

    # What libraries print must not be taken for frames.
    progress = os.dup(1)
    os.dup2(2, 1)
    film = Film(
        job.run,
        size=job.size,
        view=job.view,
        samples=job.samples,
        playback=job.playback,
        renderer=job.renderer,
        stage=job.stage,
    )
    make = PngEncoder if job.ending == FRAMES else FORMATS[job.ending].part
    with make(part, size=job.size, fps=job.fps, first=first) as encoder:
        for time in job.times[first:last]:
            encoder.add(film.draw(float(time)))
            os.write(progress, FRAME_DONE)


def main(arguments: list[str]) -> int:
    """Draw the part that the arguments name: job file, first and last frame, part file.

    A failure is left as a pickle beside the part for the caller to raise.
    """
    job_file, first, last, name = arguments
    part = Path(name)
    try:
        job = pickle.loads(Path(job_file).read_bytes())
        draw_part(job, int(first), int(last), part)
    except BrokenPipeError:
        # Nobody else is left to tidy up.
        shutil.rmtree(part.parent, ignore_errors=True)
        return 1
    except Lrf3dError as error:
        part.with_suffix(".error").write_bytes(pickle.dumps(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

_FRAMES_A_WORKER = 20
"""A process that draws fewer frames than this takes longer to start than it saves."""


def split_frames(total: int, parts: int | None, *, at_once: int) -> list[tuple[int, int]]:
    """The first frame of each part and the one after its last; no part is empty.

    Args:
        total: Frames of the film.
        parts: How many parts are asked for; None for as many as are worth starting.
        at_once: How many parts can be drawn at one time.
    """
    count = parts or min(at_once, math.ceil(total / _FRAMES_A_WORKER))
    bounds = np.linspace(0, total, min(count, total) + 1).round().astype(int).tolist()
    return list(pairwise(bounds))


def part_name(number: int) -> str:
    """The name of a part's file or folder; their order is that of the film."""
    return f"part{number:03d}"


def draw_parts(
    job: Job, folder: Path, workers: int | None, progress: FrameProgress | None
) -> tuple[list[Path], list[int]]:
    """Draw the film in parts, one process each; gives the files and how long each is [frames]."""
    cores = core_count()
    ranges = split_frames(len(job.times), workers, at_once=cores)
    job_file = folder / "job.pickle"
    job_file.write_bytes(pickle.dumps(job, pickle.HIGHEST_PROTOCOL))
    parts = [folder / part_name(number) for number in range(len(ranges))]
    threads = max(1, cores // len(ranges))
    processes: list[subprocess.Popen[bytes]] = []
    try:
        for (first, last), part in zip(ranges, parts, strict=True):
            processes.append(start_drawer(job_file, first, last, part, threads=threads))
        _follow(processes, len(job.times), progress)
        for process, part in zip(processes, parts, strict=True):
            if process.wait() != 0:
                raise failure_of(process.returncode, part)
    finally:
        for process in processes:
            end_drawer(process)
    return parts, [last - first for first, last in ranges]


def _follow(
    processes: "list[subprocess.Popen[bytes]]", total: int, progress: FrameProgress | None
) -> None:
    """Count frames until all processes have ended, or until one has failed."""
    done = 0
    with selectors.DefaultSelector() as selector:
        for process in processes:
            selector.register(process.stdout, selectors.EVENT_READ, process)  # type: ignore[arg-type]
        while selector.get_map():
            # A signal does not end this wait, so it ends now and then by itself.
            for key, _ in selector.select(0.1):
                read = os.read(key.fd, 4096)
                if not read:
                    selector.unregister(key.fileobj)
                    if key.data.wait() != 0:
                        return
                done += len(read)
            check()
            if progress is not None:
                progress(done, total)


def start_drawer(
    job_file: Path, first: int, last: int, part: Path, *, threads: int
) -> "subprocess.Popen[bytes]":
    """Start a process that draws the frames from first to before last into a part.

    Its standard output gives a byte for each frame that is done: :mod:`lrf3d.render.film_parts`.
    """
    environment = {
        **os.environ,
        # Read by Mesa's software OpenGL: more threads than cores only wait for each other.
        "LP_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    command = [sys.executable, "-m", "lrf3d.render.film_parts"]
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


def end_drawer(process: "subprocess.Popen[bytes]") -> None:
    """End a drawer, whatever it is doing, and wait until it is gone."""
    process.kill()
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


def failure_of(status: int, part: Path) -> Exception:
    """What ended a drawer: the error that it left, or the end of what it printed."""
    left = part.with_suffix(".error")
    if left.exists():
        error = pickle.loads(left.read_bytes())
        assert isinstance(error, Exception)
        return error
    log = part.with_suffix(".log").read_text(errors="replace").strip()
    return RuntimeError(f"drawing a part of the film failed with status {status}:\n{log[-3000:]}")
