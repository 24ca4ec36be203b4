"""A process that draws one part of a film: ``python -m lrf3d.render.worker JOB``.

Drawing has processes of its own because an OpenGL context belongs to a process, and because
software OpenGL is fastest with one process a core. They are started as commands: unlike with
multiprocessing, the caller's script needs no guard and may come from anywhere.

The job is a pickled :class:`Job`. On the standard output goes a byte for each frame done. When
the caller is gone, the next byte fails, and the folder of the parts is removed.
"""

import os
import pickle
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from lrf3d.errors import Lrf3dError
from lrf3d.geometry import Float
from lrf3d.run import Run

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
