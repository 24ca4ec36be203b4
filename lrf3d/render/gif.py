"""GIF: parts kept without loss, then one palette for all of the film, and dithering in a pattern.

With one palette no colour changes at a cut, and a pattern that stands still does not flicker, as
one does that spreads errors from pixel to pixel.
"""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import av.filter

FASTEST = 50.0
"""Most frames a second: browsers show what lasts less than 20 ms for a tenth of a second."""

_PALETTE = "max_colors=256:stats_mode=full"
"""All that a GIF can have: with half as many, small things such as the robot lose their colour."""

_DITHER = "dither=bayer:bayer_scale=5:diff_mode=rectangle"
"""The faintest pattern: stronger ones show on walls, and none leaves bands in the sky."""

_CENTISECOND = Fraction(1, 100)


def join_gif(
    parts: Sequence[Path],
    frames: Sequence[int],
    path: Path,
    *,
    fps: float,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Make a GIF that plays without end of parts of a film.

    All frames are gone through twice, and progress counts them so: for the palette, and with it.
    """
    total = sum(frames)

    def report(done: int) -> None:
        if progress is not None:
            progress(done, 2 * total)

    palette = _palette(parts, report)
    graph = av.filter.Graph()
    pictures = _buffer(graph, _first_frame(parts))
    colours = _buffer(graph, palette)
    chosen = graph.add("paletteuse", _DITHER)
    sink = graph.add("buffersink")
    pictures.link_to(chosen, 0, 0)
    colours.link_to(chosen, 0, 1)
    chosen.link_to(sink)
    graph.configure()
    palette.pts, palette.time_base = 0, _CENTISECOND
    colours.push(palette)
    colours.push(None)
    with av.open(str(path), "w", format="gif", options={"loop": "0"}) as film:
        rate = Fraction(fps).limit_denominator(1000)
        stream: Any = film.add_stream("gif", rate=rate)
        first = _first_frame(parts)
        stream.width, stream.height, stream.pix_fmt = first.width, first.height, "pal8"
        stream.codec_context.time_base = _CENTISECOND
        for number, frame in enumerate(_frames(parts)):
            # Rounded from the start, so that it does not add up.
            frame.pts, frame.time_base = round(number * 100 / fps), _CENTISECOND
            pictures.push(frame)
            for drawn in _drain(sink):
                film.mux(stream.encode(drawn))
            report(total + number + 1)
        pictures.push(None)
        for drawn in _drain(sink):
            film.mux(stream.encode(drawn))
        film.mux(stream.encode(None))


def _palette(parts: Sequence[Path], report: Callable[[int], None]) -> Any:
    """The colours that serve all frames of a film best, as a picture."""
    graph = av.filter.Graph()
    pictures = _buffer(graph, _first_frame(parts))
    chosen, sink = graph.add("palettegen", _PALETTE), graph.add("buffersink")
    pictures.link_to(chosen)
    chosen.link_to(sink)
    graph.configure()
    for number, frame in enumerate(_frames(parts)):
        frame.pts, frame.time_base = number, _CENTISECOND
        pictures.push(frame)
        report(number + 1)
    pictures.push(None)
    return sink.pull()


def _buffer(graph: Any, frame: Any) -> Any:
    """The place where frames like one go into a graph of filters."""
    return graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format.name, time_base=_CENTISECOND
    )


def _drain(sink: Any) -> Iterator[Any]:
    """Frames that are ready."""
    while True:
        try:
            yield sink.pull()
        except (av.BlockingIOError, av.EOFError):
            return


def _first_frame(parts: Sequence[Path]) -> Any:
    return next(_frames(parts[:1]))


def _frames(parts: Sequence[Path]) -> Iterator[Any]:
    """The frames of all parts, one after the other."""
    for part in parts:
        with av.open(str(part)) as container:
            yield from container.decode(container.streams.video[0])
