"""The pictures of a film in their order, drawn by processes of this machine at the same time.

Each process draws every n-th picture: ``python -m lrf3d.render.workers JOB NUMBER COUNT``. It
writes them to its standard output, and waits while nobody reads it, so that a film of any length
takes no more memory than a short one.
"""

import math
import os
import pickle
import select
import shutil
import subprocess
import sys
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from lrf3d.cores import core_count
from lrf3d.errors import Lrf3dError
from lrf3d.geometry import Float
from lrf3d.interrupts import check
from lrf3d.run import Run
from lrf3d.scene.shapes import Pixels
from lrf3d.scene.stage import Stage

_FRAMES_A_WORKER = 20
"""A process that draws fewer frames than this takes longer to start than it saves."""

_PIPE = 1 << 20
"""Bytes that a process can be ahead of its reader, besides the picture that it draws."""

_WAIT = 0.1
"""How often it is checked whether the film is to be stopped [s]."""


@dataclass(frozen=True, slots=True)
class Job:
    """Pictures to draw."""

    run: Run
    times: Float
    """(frames,) Times of the run [s]."""
    film: dict[str, Any]
    """What :class:`lrf3d.render.film.Film` is made with."""
    stage: Stage
    """What stands in the run's world: its light is baked once for all processes."""
    workers: int | None
    """How many processes draw; as many as are worth it if not given."""


def draw(job: Job, scratch: Path) -> Generator[Pixels, None, None]:
    """The pictures (h, w, 3) of a job, the first first, each until the next is asked for.

    What ends a process is raised here.
    """
    cores = core_count()
    total = len(job.times)
    count = min(job.workers or min(cores, math.ceil(total / _FRAMES_A_WORKER)), total)
    (scratch / "job").write_bytes(pickle.dumps(job, pickle.HIGHEST_PROTOCOL))
    width, height = job.film["size"]
    read = bytearray(3 * width * height + 1)
    with ExitStack() as ended:
        drawers = [
            ended.enter_context(_Drawer(scratch, number, count, threads=max(1, cores // count)))
            for number in range(count)
        ]
        for number in range(total):
            drawers[number % count].read_into(memoryview(read))
            yield np.frombuffer(read, np.uint8)[1:].reshape(height, width, 3)


class _Drawer:
    """A process that draws, until it is left."""

    def __init__(self, scratch: Path, number: int, count: int, *, threads: int) -> None:
        environment = {
            **os.environ,
            # Read by Mesa's software OpenGL: more threads than cores only wait for each other.
            "LP_NUM_THREADS": str(threads),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        }
        arguments = [str(scratch / "job"), str(number), str(count)]
        self._log = scratch / f"{number}.log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "lrf3d.render.workers", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                env=environment,
                bufsize=0,
                pipesize=_PIPE,
                # An interrupt is for the caller, who then ends this.
                start_new_session=True,
            )

    def read_into(self, buffer: memoryview) -> None:
        """Wait for a picture and fill a buffer with it; raise what has ended the process."""
        pipe: IO[bytes] = self._process.stdout  # type: ignore[assignment]
        while buffer:
            check()
            # A signal does not end this wait, so it ends now and then by itself.
            if select.select([pipe], [], [], _WAIT)[0]:
                read = os.readv(pipe.fileno(), [buffer])
                if not read:
                    raise self._failure()
                buffer = buffer[read:]

    def _failure(self) -> Exception:
        """What ended the process: the error that it left, or the end of what it printed."""
        status = self._process.wait()
        left = self._log.with_suffix(".error")
        if left.exists():
            error = pickle.loads(left.read_bytes())
            assert isinstance(error, Exception)
            return error
        log = self._log.read_text(errors="replace").strip()
        return RuntimeError(f"drawing the film failed with status {status}:\n{log[-3000:]}")

    def __enter__(self) -> "_Drawer":
        return self

    def __exit__(self, *error: object) -> None:
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


def _draw_share(job: Job, first: int, step: int, out: IO[bytes]) -> None:
    """Draw every ``step``-th picture from the first on, and write it with a byte ahead of it."""
    from lrf3d.render.film import Film

    film = Film(job.run, stage=job.stage, **job.film)
    for number in range(first, len(job.times), step):
        picture = film.draw(float(job.times[number]))
        out.write(b".")
        out.write(np.ascontiguousarray(picture[:, :, :3]).data)
        out.flush()


def main(arguments: list[str]) -> int:
    """Draw the share that the arguments name: the job's file, the process's number, how many.

    A failure is left as a pickle next to the job for the caller to raise.
    """
    job_file, number, count = Path(arguments[0]), int(arguments[1]), int(arguments[2])
    # What libraries print must not be taken for pictures.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        _draw_share(pickle.loads(job_file.read_bytes()), number, count, out)
    except BrokenPipeError:
        # Nobody else is left to tidy up.
        shutil.rmtree(job_file.parent, ignore_errors=True)
        return 1
    except Lrf3dError as error:
        job_file.with_name(f"{number}.error").write_bytes(pickle.dumps(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
