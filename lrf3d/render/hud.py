"""Text panels of a film: drawn with Pillow when their words change, shown as a picture."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lrf3d.geometry import Single
from lrf3d.laser import LaserScan
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import FrameRenderer, Mesh, Primitive, Texture
from lrf3d.render.scenery import Scenery
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.estimate import TRUTH, estimate_words
from lrf3d.scene.timeline import Moment
from lrf3d.text import rounded

_TITLE, _TEXT = 26, 19
"""Sizes of the letters [pixels]."""

_RADIUS = 9
"""Radius of the corners of panels [pixels]: no letter reaches into them."""

_BACK = (13, 17, 25, 168)
_INK, _PALE, _WARM = (255, 255, 255, 255), (196, 216, 242, 255), (255, 168, 140, 255)


@cache
def font(size: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """A font that comes with matplotlib; found without importing it."""
    spec = find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(folder / f"DejaVuSans{'-Bold' if bold else ''}.ttf", size)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of text.

    Args:
        words: Where each word starts, in units of the letters' size, and the word.
        colour: Red, green, blue and opacity in 0…255.
        bold: Whether it is a title.
        ends: Words by where they end: numbers whose digits stand under each other.
    """

    words: tuple[tuple[float, str], ...]
    colour: tuple[int, int, int, int]
    bold: bool = False
    ends: tuple[tuple[float, str], ...] = ()

    def placed(self, size: int) -> list[tuple[float, str]]:
        """Where each word starts [pixels], in letters of a size [pixels], and the word."""
        left = [(start * size, words) for start, words in self.words]
        right = [(end * size - self._length(words, size), words) for end, words in self.ends]
        return left + right

    def _length(self, words: str, size: int) -> float:
        return sum(glyph(letter, size, bold=self.bold)[1] for letter in words)


def _sizes(lines: tuple[Line, ...], scale: float) -> list[int]:
    """Sizes of the letters of lines [pixels]."""
    return [round((_TITLE if line.bold else _TEXT) * scale) for line in lines]


def panel_size(lines: tuple[Line, ...], scale: float) -> tuple[int, int]:
    """Width and height [pixels] of a panel with these lines."""
    sizes, pad = _sizes(lines, scale), round(12 * scale)
    width = max(
        start + font(size, bold=line.bold).getlength(words)
        for line, size in zip(lines, sizes, strict=True)
        for start, words in line.placed(size)
    )
    return int(width) + 2 * pad, 2 * pad + sum(round(1.36 * size) for size in sizes)


class Panel:
    """A box with text, as tall and wide as its first lines need."""

    def __init__(
        self, lines: tuple[Line, ...], scale: float, back: tuple[int, int, int, int] = _BACK
    ) -> None:
        self._back = back
        self._sizes = _sizes(lines, scale)
        self._pad = round(12 * scale)
        self._tops = np.cumsum([self._pad, *(round(1.36 * size) for size in self._sizes)]).tolist()
        self.size = panel_size(lines, scale)
        self._lines: tuple[Line, ...] = ()
        self._picture = rounded_box(self.size, back, _RADIUS * scale)

    def draw(self, lines: tuple[Line, ...]) -> Picture:
        """The panel with these lines; only those that changed are drawn."""
        for row, line in enumerate(lines):
            if row < len(self._lines) and self._lines[row] == line:
                continue
            top, bottom = self._tops[row : row + 2]
            cover = np.zeros((bottom - top, self.size[0]), np.uint8)
            for start, words in line.placed(self._sizes[row]):
                x = self._pad + start
                for letter in words:
                    mask, advance = glyph(letter, self._sizes[row], bold=line.bold)
                    left = round(x)
                    area = cover[: mask.shape[0], left : left + mask.shape[1]]
                    np.maximum(area, mask[: area.shape[0], : area.shape[1]], out=area)
                    x += advance
            np.take(_shades(line.colour, self._back), cover, axis=0, out=self._picture[top:bottom])
        self._lines = lines
        return self._picture


def rounded_box(size: tuple[int, int], back: tuple[int, ...], radius: float) -> Picture:
    """A box (h, w, 4) of a width and height and with round corners [pixels]."""
    x, y = (np.abs(np.arange(side) - 0.5 * (side - 1)) - (0.5 * side - radius) for side in size)
    away = np.hypot(np.maximum(x, 0.0)[None, :], np.maximum(y, 0.0)[:, None])
    picture = np.empty((size[1], size[0], 4), np.uint8)
    picture[:] = back
    picture[..., 3] = np.round(back[3] * np.clip(radius + 0.5 - away, 0.0, 1.0))
    return picture


@cache
def _shades(ink: tuple[int, ...], back: tuple[int, ...]) -> Picture:
    """The colour (256, 4) of a pixel that letters cover by 0…255."""
    cover = np.arange(256)[:, None] / 255.0
    blend = np.array(back) + cover * (np.array(ink) - np.array(back))
    if back[3] == 0:
        # On nothing, letters keep their colour to the rim.
        blend[:, :3] = ink[:3]
    return np.asarray(blend + 0.5, np.uint8)


@cache
def glyph(letter: str, size: int, *, bold: bool) -> tuple[Picture, float]:
    """How much of each pixel (h, w) a letter covers, 0…255, and the way to the next [pixels]."""
    letters = font(size, bold=bold)
    advance = letters.getlength(letter)
    picture = Image.new("L", (int(advance) + 2 + size // 4, round(1.36 * size)), 0)
    ImageDraw.Draw(picture).text((0, 0), letter, font=letters, fill=255)
    return np.asarray(picture), advance


RECTANGLE = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]], np.float32)
"""Corners of the two triangles of a picture."""


def _rim(wide: float, high: float) -> Single:
    """Corners (24, 2) of the triangles of a picture's rim, of widths in its own."""
    strips = (
        (0.0, 0.0, 1.0, high),
        (0.0, 1.0 - high, 1.0, 1.0),
        (0.0, high, wide, 1.0 - high),
        (1.0 - wide, high, 1.0, 1.0 - high),
    )
    return np.concatenate(
        [[left, low] + RECTANGLE * [right - left, top - low] for left, low, right, top in strips]
    ).astype(np.float32)


def box_of(
    picture: tuple[int, int], corner: tuple[int, int], size: tuple[int, int]
) -> tuple[float, ...]:
    """Left, top, right and bottom in −1…1 of a box of a size at a pixel of a picture (w, h)."""
    # Row 0 of the picture is OpenGL's lowest, so that y grows downward here too.
    ends = corner, (corner[0] + size[0], corner[1] + size[1])
    return tuple(
        2.0 * at / side - 1.0 for end in ends for at, side in zip(end, picture, strict=True)
    )


class Stamp:
    """A picture that is laid over the film's.

    Args:
        scenery: The scenery of the film.
        picture: (h, w, 4) uint8.
        rim: Where only a rim of it shows anything, the width of that rim [pixels].
    """

    def __init__(self, scenery: Scenery, picture: Picture, rim: int | None = None) -> None:
        self.size = (picture.shape[1], picture.shape[0])
        corners = RECTANGLE if rim is None else _rim(rim / self.size[0], rim / self.size[1])
        self._quad = Primitive("label", (2,), corners, blend=True)
        self._quad.texture = self._texture = Texture(picture)
        self._box: tuple[float, ...] = (-1.0, -1.0, 1.0, 1.0)
        scenery.scene.add(Mesh([self._quad]))

    def place(self, picture: tuple[int, int], left: int, top: int) -> None:
        """Put its upper left corner to a pixel of a picture (width, height)."""
        self._box = box_of(picture, (left, top), self.size)

    def draw(self, renderer: FrameRenderer) -> None:
        """Draw it over the picture."""
        renderer.draw(self._quad, {"box": self._box})


class Label(Stamp):
    """A panel in the picture.

    Args:
        scenery: The scenery of the film.
        lines: Lines as wide as any that it will show, and the first that it does.
        scale: Size of the letters against their size at 720 lines.
        back: Colour behind the words.
    """

    def __init__(
        self,
        scenery: Scenery,
        lines: tuple[Line, ...],
        scale: float,
        back: tuple[int, int, int, int] = _BACK,
    ) -> None:
        self._panel = Panel(lines, scale, back)
        super().__init__(scenery, self._panel.draw(lines))
        self._shown = lines

    def show(self, lines: tuple[Line, ...]) -> None:
        """Change its words."""
        if lines != self._shown:
            self._shown = lines
            self._texture.update(self._panel.draw(lines))


class Hud:
    """The panel in the upper left corner that says what happens.

    Args:
        scenery: The scenery of the film.
        size: Width and height of the film's pictures [pixels].
        scale: Size of the letters against their size at 720 lines.
        gap: Free border to the corner [pixels].
        playback: Seconds of the run in a second of the film.
    """

    def __init__(
        self, scenery: Scenery, size: tuple[int, int], scale: float, gap: int, playback: float
    ) -> None:
        self._run, self._playback = scenery.run, playback
        self._label = Label(scenery, widest_lines(self._run, playback), scale)
        self._label.place(size, gap, gap)

    def lines(self, moment: Moment) -> tuple[Line, ...]:
        """What it says of a moment."""
        scan, line_map = self._run.scan(moment.scan), self._run.map_after(moment.scan)
        return hud_lines(self._run, moment, scan, line_map.counts, self._playback)

    def draw(self, renderer: FrameRenderer, lines: tuple[Line, ...]) -> None:
        """Draw it over the picture."""
        renderer.overlay(None)
        self._label.show(lines)
        self._label.draw(renderer)


_COLUMN, _WIDER = 5.8, 1.3
"""Width of a column with its letter and number, and what coordinates of six digits need more."""

_BETWEEN = 1.0
"""Gap between two columns, like their widths in units of the letters' size."""


def hud_lines(
    run: Run, moment: Moment, scan: LaserScan, counts: str, playback: float
) -> tuple[Line, ...]:
    """What the panel says.

    The world and how fast it is played; time and speed; the pose; beams that hit and the nearest;
    and what the map counts, where there is one.
    """
    x, y, turn = (
        rounded(value, digits)
        for value, digits in (
            (moment.pose[0], 2),
            (moment.pose[1], 2),
            (np.degrees(moment.pose[2]), 1),
        )
    )
    # Numbers keep their places: text that trembles cannot be read in a film.
    corner = np.abs(run.trajectory.poses[:, :2]).max()
    wide = _COLUMN + (_WIDER if corner >= 1000.0 else 0.0)
    starts = [number * (wide + _BETWEEN) for number in range(3)]
    ends = [start + wide for start in starts]
    full, speed = ends[2] * _TEXT / _TITLE, f"{playback:g} ×"
    title = _shortened(f"lrf3d  {run.world.name}".rstrip(), full - _BETWEEN - _width(speed))
    if moment.scanning:
        nearest = f"min {scan.ranges[scan.hits].min():.2f} m" if scan.hits.any() else "nothing near"
        hit = f"{int(scan.hits.sum())} / {len(scan.ranges)} beams hit"
        beams = Line(((0.0, hit),), _WARM, ends=((ends[2], nearest),))
    else:
        beams = Line(((0.0, "driving on, beams off"),), _WARM)
    lines = (
        Line(((0.0, title),), _INK, True, ((full, speed),)),
        Line(
            ((starts[0], "t"), (starts[1], "v")),
            _PALE,
            ends=((ends[0], f"{moment.time:.1f} s"), (ends[1], f"{moment.speed:.2f} m/s")),
        ),
        Line(
            ((starts[0], "x"), (starts[1], "y"), (starts[2], "θ")),
            _PALE,
            ends=((ends[0], x), (ends[1], y), (ends[2], f"{turn}°")),
        ),
        beams,
        *_legend(run, moment.scan, ends[2]),
    )
    return (*lines, Line(((0.0, counts),), _PALE)) if run.maps else lines


@cache
def _width(words: str) -> float:
    """The width of words of a title, in units of the letters' size."""
    return float(font(_TITLE, bold=True).getlength(words)) / _TITLE


@cache
def _shortened(title: str, room: float) -> str:
    """As much of a title as there is room for, in units of the letters' size."""
    if len(title) < 100 and _width(title) <= room:
        return title
    # However long a name is, no panel shows more letters.
    cut = (f"{title[:count].rstrip()}…" for count in range(min(len(title), 100), 0, -1))
    return next((shown for shown in cut if _width(shown) <= room), "…")


def _legend(run: Run, scan: int, end: float) -> Iterator[Line]:
    """The names of the two trails in their colours, and how far they are apart."""
    for name, apart in estimate_words(run, scan):
        colour = look.TRAIL_COLOUR if name == TRUTH else look.ESTIMATE_COLOUR
        # On a dark panel colours are read more easily when they are paler.
        red, green, blue = (round(255 * (0.65 * part + 0.35)) for part in colour)
        ends = ((end, apart),)
        yield Line(((0.0, f"━ {name}"),), (red, green, blue, 255), ends=ends)


def widest_lines(run: Run, playback: float = 1.0) -> tuple[Line, ...]:
    """Lines as wide as any that the run will have, to size the panel by."""
    times = run.trajectory.times
    poses = run.trajectory.poses
    corner = np.abs(poses[:, :2]).max(axis=0)
    count = len(run.lrf.angles)
    pose = np.array([-corner[0], -corner[1], np.radians(-179.9)])
    scan = LaserScan((0.0, 0.0, 0.0), np.zeros(count), np.full(count, 88.88))
    moment = Moment(float(times[-1]), pose, 0, 88.88, True)
    return hud_lines(run, moment, scan, run.map.counts, playback)
