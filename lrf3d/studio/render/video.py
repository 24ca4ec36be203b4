"""Films of a run: drawn with OpenGL or with Embree, by as many processes as asked."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from functools import reduce
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.files import as_path, replacing, unfinished_folder
from lrf3d.base.interrupts import Progress, silent, stoppable
from lrf3d.geometry.lines import Float, is_finite, number, whole_number
from lrf3d.simulation.run import Run
from lrf3d.studio.render.film import SLACK, FilmOptions
from lrf3d.studio.render.workers import Job, draw
from lrf3d.studio.scene.moments import MARKS
from lrf3d.studio.scene.shapes import Pixels
from lrf3d.studio.scene.stage.exposure import Exposure
from lrf3d.studio.scene.stage.stage import stage_of
from lrf3d.studio.scene.timeline import Timeline
from lrf3d.studio.scene.views import film_times, margin

# Compression of pictures 0…9, beyond which a file takes twice the time and hardly gets smaller.
_EFFORT = 4

# Number of pictures of a film that choose the colours of a GIF: more choose the same ones.
_EXAMPLES = 24


@stoppable()
def render_video(
    run: Run,
    path: str | Path,
    *,
    fps: float = 25.0,
    workers: int | None = None,
    part: tuple[float | None, float | None] = (None, None),
    columns: Mapping[str, Run] | None = None,
    maps: Mapping[str, Run] | None = None,
    progress: Progress = silent,
    **options: Any,
) -> None:
    """Draw a run as a film: H.264 in .mp4, or a looping animation in .webp or .gif.

    Args:
        run: The run.
        path: The file to write; it appears whole or not at all. Its ending says which kind.
        fps: Frames a second; a .gif can have up to 50, a .webp up to 200.
        workers: Number of processes; as many as there are cores if not given.
        part: From when to when the run is shown [s]; from its start, to its end if not given.
        columns: The same drive under other conditions, by their names, the run among them: a story
            opens with the run, and then the maps of all stand side by side under the ``title``.
        maps: Runs of robots that drive at the same time, by their names, the run first; the map of
            each is shown.
        progress: Called with frames done and frames in all, as the film grows.
        options: ``size``, width and height [pixels] (1280, 720), both even for .mp4;
            ``playback``, seconds of the run in a second of the film; ``view``, the camera:
            ``story``, ``chase``, ``first``, ``orbit``, ``overview``, ``top`` or one of the world's;
            ``length`` of the film [s], 15 for a story, which shows parts of a longer run;
            ``samples`` a pixel: 1, whose edges are smoothed, 4, or 0 for jagged edges;
            ``renderer``, ``gl``, or ``embree`` which needs no OpenGL and takes longer; ``panel``,
            ``short`` for three facts or ``full`` for all numbers. If not given, the run has its own
            view and playback, and OpenGL draws where it is there.

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
    from lrf3d.studio.render.encode import encode, format_of

    expect(progress, Callable, "progress")
    path = as_path(path)
    chosen = FilmOptions(**options, rushes=part == (None, None)).of(run)
    fps = number(fps, "fps", positive=True)
    if workers is not None:
        workers = whole_number(workers, "workers")
    kind = format_of(path, chosen.size, fps)
    times = _frame_times(run, chosen, fps, part)
    total = len(times)
    examples = np.linspace(0, total - 1, min(total, _EXAMPLES) * kind.palette).astype(int)
    stage = stage_of(run)
    others, compared = (
        {name: (each, stage_of(each)) for name, each in (some or {}).items()}
        for some in (maps, columns if chosen.view == "story" else None)
    )
    # Robots that drive at the same time light one world, whose frame goes with what each sees.
    frames = [(one.exposure, one.structures.origin) for _, one in others.values()]
    lights = [
        replace(one, corner=one.corner + origin - stage.structures.origin) for one, origin in frames
    ]
    light = reduce(Exposure.joined, lights, stage.exposure)
    shown_times = np.concatenate([times[examples], times])
    stage = stage._replace(exposure=light)
    job = Job(run, chosen, stage, shown_times, MARKS, others, compared)

    def counted(pictures: Iterable[Pixels]) -> Iterator[Pixels]:
        for done, picture in enumerate(pictures, 1):
            yield picture
            progress(done, total)

    with replacing(path) as unfinished, unfinished_folder(path) as folder:
        # A folder that cannot be written to is better known before the film is drawn.
        unfinished.touch()
        with closing(draw(job, folder, workers)) as pictures:
            encode(
                counted(pictures),
                unfinished,
                kind,
                fps=fps,
                examples=list(islice(pictures, len(examples))),
            )


def _frame_times(
    run: Run, options: FilmOptions, fps: float, part: tuple[float | None, float | None]
) -> Float:
    """The times (n,) of the frames from a first to a last time of the run [s]."""
    ends = part if isinstance(part, tuple) and len(part) == 2 else ("", "")
    if not all(end is None or is_finite(end) for end in ends):
        raise InputError(f"part {shown(part)}: expected the first and the last time [s], or None")
    low, high = (
        limit if e is None else e for e, limit in zip(part, (-np.inf, np.inf), strict=True)
    )
    timeline = Timeline(run, playback=options.playback)
    view = str(options.view)
    if low == -np.inf and high == np.inf:
        return film_times(view, timeline, fps, options.length)
    # A given part of the run is shown without gaps.
    times = timeline.frame_times(fps, margin(view))
    chosen = times[(times >= low - SLACK) & (times <= high + SLACK)]
    if not len(chosen):
        raise InputError(
            f"part from {low:g} to {high:g} s: the run goes from {timeline.start:g} to"
            f" {timeline.end:g} s, and no frame lies there"
        )
    return np.asarray(chosen)


def save_png(picture: Pixels, path: Path) -> None:
    """Write a picture (h, w, 3 or 4) uint8; it is opaque, so that three values a pixel are kept."""
    Image.fromarray(picture[:, :, :3]).save(path, compress_level=_EFFORT)
