"""The pictures of a film in their order, drawn by processes of this machine at the same time.

Each process draws every n-th picture. It waits while nobody reads its pipe, so that a film of any
length takes no more memory than a short one. No pool of Python's is used: its processes would run
the script again that asks for the film.
"""

import math
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lrf3d.base.cores import core_count
from lrf3d.base.errors import InputError, Lrf3dError
from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Float
from lrf3d.simulation.run import Run
from lrf3d.studio.render.film import Film, FilmOptions
from lrf3d.studio.scene.moments import MARKS
from lrf3d.studio.scene.shapes import Mark, Pixels
from lrf3d.studio.scene.stage.stage import Stage

# Number of frames of which fewer take a process longer to start than it saves.
_FRAMES_A_WORKER = 20

# What a process runs, with the file of the job, its number, that of all, and its end of the pipe.
_PROGRAM = """
import sys
from lrf3d.base.lean import lean_loading
with lean_loading():
    from lrf3d.studio.render.workers import main
main(*sys.argv[1:])
"""

# Time between two checks whether the film is to be stopped [s].
_WAIT = 0.1


class Job(NamedTuple):
    """Pictures to draw, at times (frames,) of a run [s].

    The maps of others stand beside it, or are compared, by their names; stages are painted once for
    all.
    """

    run: Run
    look: FilmOptions
    stage: Stage
    times: Float
    marks: dict[str, Callable[..., Mark | None]]
    maps: dict[str, tuple[Run, Stage]]
    compared: dict[str, tuple[Run, Stage]]


def draw(job: Job, scratch: Path, workers: int | None) -> Generator[Pixels, None, None]:
    """The pictures (h, w, 3) of a job, drawn by that number of processes, or as many as pay.

    What ends a process is raised here.
    """
    for name, mark in MARKS.items():
        if "<" in mark.__qualname__ or mark.__module__ == "__main__":
            found = f"mark {name!r} of {mark.__module__}.{mark.__qualname__}"
            raise InputError(f"{found}: other processes draw films; define it in a module")
    cores = core_count()
    total = len(job.times)
    count = min(workers or min(cores, math.ceil(total / _FRAMES_A_WORKER)), total)
    (scratch / "job").write_bytes(pickle.dumps(job, pickle.HIGHEST_PROTOCOL))
    with ExitStack() as ended:
        processes = [
            ended.enter_context(_process(scratch, number, count, threads=max(1, cores // count)))
            for number in range(count)
        ]
        for number in range(total):
            yield processes[number % count]()


@contextmanager
def _process(
    scratch: Path, number: int, count: int, *, threads: int
) -> Iterator[Callable[[], Pixels]]:
    """A process, which ends with the block, and what waits for its next picture."""
    environment = {
        **os.environ,
        # Read by Mesa's software OpenGL: more threads than cores only wait for each other.
        "LP_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    pipe, end = Pipe(duplex=False)
    log = scratch / f"{number}.log"
    with end, log.open("wb") as said:
        arguments = [scratch / "job", number, count, end.fileno()]
        process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            env=environment,
            pass_fds=[end.fileno()],
            # An interrupt is for the caller, who then ends this.
            start_new_session=True,
        )

    def picture() -> Pixels:
        while not pipe.poll(_WAIT):
            check()
        try:
            sent = pipe.recv()
        except (EOFError, OSError):
            # Between two pictures, or in the middle of one, as when the system runs out of memory.
            words = f"drawing the film failed with status {process.wait()}"
            printed = log.read_text(errors="replace").strip()
            raise RuntimeError(f"{words}:\n{printed[-3000:]}") from None
        if isinstance(sent, Lrf3dError):
            raise sent
        return np.asarray(sent)

    try:
        yield picture
    finally:
        process.kill()
        process.wait()
        pipe.close()


def main(job_file: str, number: str, count: str, pipe: str) -> None:
    """Draw every ``count``-th picture of a job from a number on, or say why not."""
    end = Connection(int(pipe), readable=False)
    try:
        job: Job = pickle.loads(Path(job_file).read_bytes())
        MARKS.update(job.marks)
        sides = {"maps": job.maps, "compared": job.compared}
        film = Film(job.run, stage=job.stage, **sides, **asdict(job.look))
        for time in job.times[int(number) :: int(count)].tolist():
            end.send(film.draw(time))
    except BrokenPipeError:
        # Nobody else is left to tidy up.
        shutil.rmtree(Path(job_file).parent, ignore_errors=True)
    except Lrf3dError as error:
        end.send(error)
