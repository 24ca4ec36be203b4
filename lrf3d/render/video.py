"""Films and pictures of a run: drawn with OpenGL or with Embree, by as many processes as asked."""

import math
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.errors import InputError, shown
from lrf3d.files import replacing, unfinished_folder
from lrf3d.geometry import Float, is_finite, read_only, whole_number
from lrf3d.interrupts import stoppable
from lrf3d.progress import Progress, silent
from lrf3d.render.gl import gl_available, require_gl
from lrf3d.render.workers import Job, draw
from lrf3d.run import Run
from lrf3d.scene.cameras import margins
from lrf3d.scene.panel import PANELS
from lrf3d.scene.shapes import Pixels
from lrf3d.scene.stage import stage_of
from lrf3d.scene.timeline import Timeline
from lrf3d.world.cameras import MOVING_VIEWS, check_view

RENDERERS = ("embree", "gl")
"""Names of the renderers: Embree's, which needs nothing but wheels, and OpenGL's, the fast one."""

VIEWS = MOVING_VIEWS
"""Names of the cameras that every world has."""

SAMPLES = (0, 4)
"""Samples a pixel that can be asked for."""

_SLACK = 1e-6
"""How far past its end a run can still be looked at [s]: sums of steps are rounded."""

_SMALLEST, _LARGEST = 16, 8192
"""Sides of pictures [pixels] that can be drawn."""

_EFFORT = 4
"""Compression of pictures 0…9: beyond, a file takes twice the time and hardly gets smaller."""

_EXAMPLES = 24
"""How many pictures of a film choose the colours of a GIF: more choose the same ones."""


@dataclass(frozen=True, slots=True)
class FilmOptions:
    """How pictures of a run are drawn: the options of :func:`render_video` that all share."""

    size: tuple[int, int] = (1280, 720)
    playback: float | None = None
    view: str | None = None
    samples: int = 4
    renderer: str | None = None
    panel: str = "short"

    def of(self, run: Run) -> dict[str, Any]:
        """What a :class:`~lrf3d.render.film.Film` is made with; what is not given, the run says.

        Raises:
            InputError: An option is invalid.
        """
        view = run.film.view if self.view is None else self.view
        playback = run.film.playback if self.playback is None else self.playback
        sides = self.size if isinstance(self.size, tuple | list) else ()
        if len(sides) != 2 or not all(
            is_finite(side) and side == int(side) and _SMALLEST <= side <= _LARGEST
            for side in sides
        ):
            raise InputError(
                f"size {shown(self.size)}: expected width and height,"
                f" {_SMALLEST} to {_LARGEST} pixels each"
            )
        if not isinstance(view, str):
            raise InputError(f"view {shown(view)}: expected the name of a camera")
        check_view(view, run.world.cameras)
        if not (is_finite(self.samples) and self.samples in SAMPLES):
            raise InputError(f"samples {shown(self.samples)}: expected 0 or 4")
        if not (is_finite(playback) and playback > 0.0):
            raise InputError(f"playback {shown(playback)}: expected a number of more than 0")
        if self.panel not in PANELS:
            raise InputError(f"panel {shown(self.panel)}: expected one of {', '.join(PANELS)}")
        return asdict(self) | {
            "size": (int(sides[0]), int(sides[1])),
            "view": view,
            "playback": float(playback),
            "renderer": choose_renderer(self.renderer),
        }


@stoppable()
def render_video(
    run: Run,
    path: str | Path,
    *,
    size: tuple[int, int] = (1280, 720),
    fps: float = 25.0,
    playback: float | None = None,
    view: str | None = None,
    samples: int = 4,
    workers: int | None = None,
    renderer: str | None = None,
    panel: str = "short",
    part: tuple[float | None, float | None] = (None, None),
    progress: Progress = silent,
) -> None:
    """Draw a run as a film: H.264 in .mp4, or a looping animation in .webp or .gif.

    Args:
        run: The run.
        path: The file to write; it appears whole or not at all. Its ending says which kind.
        size: Width and height [pixels], both even for .mp4.
        fps: Frames a second; a .gif can have up to 50, a .webp up to 200.
        playback: Seconds of the run in a second of the film; the run's own if not given.
        view: Name of the camera: ``story``, ``chase``, ``first``, ``orbit``, ``overview``, ``top``,
            or one of the world's; the run's own if not given.
        samples: Samples a pixel against jagged edges: 4, or 0 for none.
        workers: Number of processes; as many as there are cores if not given.
        renderer: What draws: ``gl``, or ``embree`` which needs no OpenGL and takes longer; where
            not given, OpenGL where it is there.
        panel: What the panel says: ``short``, three facts, or ``full``, all numbers.
        part: From when to when the run is shown [s]; from its start, to its end if not given.
        progress: Called with frames done and frames in all, as the film grows.

    Raises:
        InputError: An argument is out of its range.
        MissingLibraryError: OpenGL is asked for, or is there, and cannot draw.
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> lrf3d.render_video(run, "run.gif", size=(64, 64), fps=1, renderer="embree", workers=1)
    """
    from lrf3d.render.encode import encode, format_of

    path = Path(path)
    options = FilmOptions(size, playback, view, samples, renderer, panel)
    job = _job(run, options, fps, part, workers)
    kind = format_of(path, job.film["size"], fps)
    total = len(job.times)
    chosen = np.linspace(0, total - 1, min(total, _EXAMPLES) * kind.palette).astype(int)
    job = replace(job, times=np.concatenate([job.times[chosen], job.times]))
    with replacing(path) as unfinished, unfinished_folder(path) as folder:
        # A folder that cannot be written to is better known before the film is drawn.
        unfinished.touch()
        with closing(draw(job, folder)) as pictures:
            examples = [picture.copy() for picture in islice(pictures, len(chosen))]
            encode(
                _counted(pictures, total, progress), unfinished, kind, fps=fps, examples=examples
            )


def _counted(pictures: Iterable[Pixels], total: int, progress: Progress) -> Iterator[Pixels]:
    """The pictures; progress is called after each with their number and that of all."""
    for number, picture in enumerate(pictures):
        yield picture
        progress(number + 1, total)


def frame(
    run: Run, time: float, *, goal: tuple[float, float, float] | None = None, **options: Any
) -> NDArray[np.uint8]:
    """The picture (h, w, 3) of a run at a time, with a goal x, y, radius [m]: see `Run.frame`."""
    film = FilmOptions(**options).of(run)
    if not is_finite(time):
        raise InputError(f"time {shown(time)}: expected a finite number of seconds")
    if goal is not None:
        place = read_only(goal, "goal")
        if place.shape != (3,) or not is_finite(*place):
            raise InputError(f"goal {shown(goal)}: expected x, y and radius [m]")
        goal = tuple(place.tolist())
    timeline = Timeline(run, playback=film["playback"])
    # The pictures of the opening and the end can be looked at, too.
    before, after = (film["playback"] * margin for margin in margins(film["view"]))
    low, high = timeline.start - before, timeline.end + after
    # Checked before anything is painted, which takes seconds.
    if not low - _SLACK <= time <= high + _SLACK:
        raise InputError(
            f"time {time:g} s: the run goes from {timeline.start:g} to {timeline.end:g} s"
        )
    return np.array(_film(run, goal=goal, **film).draw(time)[:, :, :3])


def save_png(picture: Pixels, path: Path) -> None:
    """Write a picture (h, w, 3 or 4) uint8; it is opaque, so that three values a pixel are kept."""
    Image.fromarray(picture[:, :, :3]).save(path, compress_level=_EFFORT)


@lru_cache(maxsize=1)
def _film(run: Run, **options: Any) -> Any:
    """The film of the pictures asked for last: setting one up costs as much as forty pictures."""
    from lrf3d.render.film import Film

    return Film(run, **options)


def _job(
    run: Run,
    options: FilmOptions,
    fps: float,
    part: tuple[float | None, float | None],
    workers: int | None,
) -> Job:
    """The pictures of a film, when all that is asked for can be drawn."""
    film = options.of(run)
    if not (is_finite(fps) and fps > 0.0):
        raise InputError(f"fps {shown(fps)}: expected a number of more than 0")
    if workers is not None:
        workers = whole_number(workers, "workers")
    if not (isinstance(part, tuple) and [*map(_is_time, part)] == [True, True]):
        raise InputError(f"part {shown(part)}: expected the first and the last time [s], or None")
    timeline = Timeline(run, playback=film["playback"])
    times = _within(timeline, timeline.frame_times(fps, margins(film["view"])), *part)
    # Worked out here once, it goes with the run to all that draw.
    _ = run.lasting_objects
    return Job(run, times, film, stage_of(run), workers)


def _within(timeline: Timeline, times: Float, first: float | None, last: float | None) -> Float:
    """Those of the frames' times (n,) from a first to a last time of the run [s]."""
    low = -math.inf if first is None else first
    high = math.inf if last is None else last
    chosen = times[(times >= low - _SLACK) & (times <= high + _SLACK)]
    if not len(chosen):
        raise InputError(
            f"part from {low:g} to {high:g} s: the run goes from {timeline.start:g} to"
            f" {timeline.end:g} s, and no frame lies there"
        )
    return np.asarray(chosen)


def _is_time(value: object) -> bool:
    return value is None or is_finite(value)


def choose_renderer(wanted: str | None) -> str:
    """The renderer of a name; where none is named, OpenGL's where it is there, else Embree's."""
    if wanted is None:
        return "gl" if gl_available() else "embree"
    if wanted not in RENDERERS:
        raise InputError(f"renderer {wanted!r}: expected one of {', '.join(RENDERERS)}")
    if wanted == "gl":
        require_gl()
    return wanted
