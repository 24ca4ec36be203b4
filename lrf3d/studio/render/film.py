"""Film: the pictures of a run, one for each time asked for, and the options of all films.

Text and the frame of the inset are laid over what a renderer draws.
"""

from collections.abc import Collection
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache
from importlib.util import find_spec
from itertools import compress, groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.latest import Latest
from lrf3d.geometry.lines import is_finite, number, read_only, whole_number
from lrf3d.simulation.run import Run
from lrf3d.studio.render.gl import gl_available, import_libraries, require_gl
from lrf3d.studio.scene import panel
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.inset import InsetView
from lrf3d.studio.scene.look import PLAN_BACK, SIZE, WHITE, scale
from lrf3d.studio.scene.moments import LAYERS, Goal, Scene
from lrf3d.studio.scene.shapes import NAMED, Label, Pixels
from lrf3d.studio.scene.shots import LENGTH, LONGEST, SHORTEST
from lrf3d.studio.scene.stage.stage import Stage
from lrf3d.studio.scene.story import Story
from lrf3d.studio.scene.timeline import Timeline, smoothed
from lrf3d.studio.scene.views import make_camera, margins
from lrf3d.world.cameras import check_view

# Time past its end at which a run can still be shown [s], as sums of steps are rounded.
SLACK = 1e-6

# Smallest side of a picture [pixels].
_SMALLEST = 16

# Largest side of a picture [pixels], which graphics cards still draw.
_LARGEST = 8192

# Largest width of the inset, in that of the picture.
_WIDEST = 0.19

# Least side of the inset, of which a smaller one is left out [pixels].
_LEAST_SIDE = 30

# Height of a line in letters.
_LINE = 1.36

# What stands between texts of a row.
_APART = "   "

# Size of all lines but the first, in that of the first.
_LESSER = 0.64

# Free border round text and the inset [pixels of 720 lines].
_GAP = 16

# Least number of times its size at 720 lines that text has.
_LEAST_SCALE = 0.47

# Height of letters from which on text is legible; smaller text is left out [pixels].
_LEAST_LETTER = 6.5

# Largest share of the height of a picture that text may cover; more is left out.
_MOST_COVERED = 0.5

# Share of the picture's light that is taken in the corner under text.
_DARKEST = 0.74

# Size of the darkened corner, in the text's.
_SHADED = 1.6

# Half the width of the frame of the inset, and of its scale [pixels of 720 lines].
_FRAME = 1.2

# Colour of the frame of the inset, 0…255.
_FRAME_COLOUR = (38, 50, 72)

# Colour of the scale of the inset, 0…255.
_BAR_COLOUR = (200, 210, 228)

# Height of the letters of the scale [pixels of 720 lines].
_BAR_LETTER = 20

# Names of the renderers: Embree's, which needs nothing but wheels, and OpenGL's, the fast one.
_RENDERERS = ("embree", "gl")


@dataclass(frozen=True, slots=True)
class FilmOptions:
    """How pictures of a run are drawn: see :func:`lrf3d.render_video`."""

    size: tuple[int, int] = SIZE
    view: str | None = None
    playback: float | None = None
    # Length of the film [s]; a story has 15 s if it is not given.
    length: float | None = None
    samples: int = 1
    renderer: str | None = None
    panel: str = "short"
    # What is drawn over the scene.
    layers: Collection[str] = LAYERS
    # A goal to be marked on the ground.
    goal: Goal | None = None
    # What the picture is called.
    title: str = ""
    # Whether times follow that a story leaps over.
    leaps: bool = True

    def of(self, run: Run) -> "FilmOptions":
        """These options, where the run and the machine choose what is not given.

        Raises:
            InputError: An option is invalid.
            MissingLibraryError: OpenGL is asked for and is not there.
        """
        expect(run, Run, "run")
        view = run.film.view if self.view is None else self.view
        usual = LENGTH if self.length is None else self.length
        length = number(usual, "length", least=SHORTEST, most=LONGEST)
        playback = self.playback
        if playback is None and view == "story":
            # It shows only parts of a long run, at the usual speed.
            playback = run.film.playback_of(0.0)
        elif playback is None:
            playback = run.playback if self.length is None else run.trajectory.duration / length
        paired = isinstance(self.size, tuple | list) and len(self.size) == 2
        _check(paired, "size", self.size, "width and height [pixels]")
        _check(isinstance(view, str), "view", view, "the name of a camera")
        check_view(view, run.world.cameras)
        sampled = is_finite(self.samples) and self.samples in (0, 1, 4)
        _check(sampled, "samples", self.samples, "0, 1 or 4")
        _check(self.panel in panel.PANELS, "panel", self.panel, f"one of {', '.join(panel.PANELS)}")
        limits = {"least": _SMALLEST, "most": _LARGEST}
        width, height = (whole_number(side, "size", **limits) for side in self.size)
        return replace(
            self,
            size=(width, height),
            view=view,
            playback=number(playback, "playback", positive=True),
            length=length,
            renderer=choose_renderer(self.renderer),
            layers=frozenset(self.layers),
            goal=self._checked_goal(),
        )

    def _checked_goal(self) -> Any:
        if self.goal is None:
            return None
        goal = read_only(self.goal, "goal")
        _check(goal.shape == (3,) and is_finite(*goal), "goal", self.goal, "x, y and radius [m]")
        return tuple(goal.tolist())


def _check(good: bool, name: str, value: object, expected: str) -> None:
    if not good:
        raise InputError(f"{name} {shown(value)}: expected {expected}")


def choose_renderer(wanted: str | None) -> str:
    """The renderer of a name; where none is named, OpenGL's where it is there, else Embree's."""
    if wanted is None:
        return "gl" if gl_available() else "embree"
    _check(wanted in _RENDERERS, "renderer", wanted, f"one of {', '.join(_RENDERERS)}")
    if wanted == "gl":
        require_gl()
    return wanted


class Film:
    """Draws pictures of a run, whose stage may have been painted already.

    The options are those of :class:`FilmOptions`.
    """

    def __init__(self, run: Run, *, stage: Stage | None = None, **options: Any) -> None:
        chosen = FilmOptions(**options).of(run)
        if chosen.renderer == "gl":
            # Before anything is painted, which takes seconds.
            import_libraries()
        self.run = run
        self.timeline = Timeline(run, playback=chosen.playback)
        self.scene = Scene(self.timeline, chosen.goal, stage)
        # Only what the renderer needs is imported.
        self.renderer: Any
        if chosen.renderer == "gl":
            from lrf3d.studio.render.renderer import Renderer

            self.renderer = Renderer(self.scene.stage, chosen.size, chosen.samples)
        else:
            from lrf3d.studio.render.plain import PlainRenderer

            self.renderer = PlainRenderer(self.scene.stage, chosen.size)
        self.camera = make_camera(str(chosen.view), self.timeline, self.scene.stage, chosen.length)
        if isinstance(self.camera, Story):
            self.camera.leaps = chosen.leaps
        self._size = chosen.size
        self._layers = chosen.layers
        self._full = chosen.panel == "full"
        self._title = chosen.title
        width, height = chosen.size
        self._window = self.scene.inset_view(upright=True)
        gap = round(_GAP * _scale_of(chosen.size))
        wide = round(min((height - 4 * gap) / self._window.aspect, _WIDEST * width))
        self._box = width - gap - wide, gap, wide, round(wide * self._window.aspect)
        shown = "inset" in chosen.layers and min(self._box[2:]) >= _LEAST_SIDE
        # Width of the strip with the inset [pixels], in which nothing else is drawn.
        self._strip = shown * (wide + 2 * gap)
        self._picture: Pixels = np.zeros((0, 0, 3), np.uint8)

    def draw(self, time: float) -> Pixels:
        """The picture (h, w, 3) uint8 at a time of the run [s]; the next one writes over it."""
        moment = self.timeline.moment(time)
        view = self._view(time)
        seen = self.scene.seen(moment, view, self._size, self._layers)
        # What is left of the picture; the strip leaves it to the right.
        width, _ = self._size
        columns = width - round(view.inset * self._strip)
        left, top, wide, high = self._box
        left += columns - (width - self._strip)
        if columns < width:
            box = left, top, wide, high
            seen = seen._replace(inset=self.scene.inset(moment, box, self._window))
        self._picture = self.renderer.draw(seen._replace(columns=columns))
        if columns < width:
            strip = np.full((self._size[1], self._strip, 3), PLAN_BACK, np.uint8)
            plan = self._picture[top : top + high, left : left + wide]
            box = left - columns, top, wide, high
            strip[top : top + high, box[0] : box[0] + plan.shape[1]] = plan
            _lay_frame(strip, box, self._window, _scale_of(self._size))
            self._picture[:, columns:] = strip[:, : width - columns]
        if "hud" in self._layers:
            label = panel.panel(self.run, moment, view, self.timeline.playback, full=self._full)
            if self._title:
                first, *_ = label.colours
                text = self._title, *label.text
                label = label._replace(text=text, colours=(first, *label.colours))
            _lay_label(self._picture[:, :columns], label)
        return self._picture

    def _view(self, time: float) -> Look:
        """The look at a time, in what the strip of the map leaves of the picture."""
        width, height = self._size
        view = self.camera.look(time, width / height)
        if not (self._strip and view.inset):
            return view
        # A story frames the robot and has the same path whether there is a strip or not.
        if not isinstance(self.camera, Story):
            view = self.camera.look(time, (width - self._strip) / height)
        return replace(view, aside=view.inset * self._strip / width)

    def close(self) -> None:
        """Free what the driver holds."""
        self.renderer.close()


def frame(run: Run, time: float, **options: Any) -> NDArray[np.uint8]:
    """The picture (h, w, 3) of a run at a time, with a goal x, y, radius [m]: see `Run.frame`."""
    chosen = FilmOptions(**options, leaps=False).of(run)
    if not is_finite(time):
        raise InputError(f"time {shown(time)}: expected a finite number of seconds")
    timeline = Timeline(run, playback=chosen.playback)
    # The pictures of the opening and the end can be drawn, too.
    before, after = (timeline.playback * margin for margin in margins(str(chosen.view)))
    # Checked before anything is painted, which takes seconds.
    if not timeline.start - before - SLACK <= time <= timeline.end + after + SLACK:
        raise InputError(
            f"time {time:g} s: the run goes from {timeline.start:g} to {timeline.end:g} s"
        )
    return np.array(_film(run, chosen).draw(time))


# The film of the pictures asked for last: setting one up costs as much as forty pictures.
_FILMS = Latest()

# What closes it: the driver's memory is not freed by itself, and environments draw a new run in
# each step.
_OPEN = ExitStack()


def _film(run: Run, options: FilmOptions) -> Film:
    def opened() -> Film:
        film = Film(run, **asdict(options))
        _OPEN.close()
        return _OPEN.enter_context(closing(film))

    return _FILMS.of((run, options), opened)


def _scale_of(size: tuple[int, int]) -> float:
    """How many times its size at 720 lines text is in a picture of a size [pixels]."""
    return scale(size, _LEAST_SCALE)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    """The sans face of the page, which comes with matplotlib; that is not imported."""
    spec = find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(folder / "DejaVuSans.ttf", size)


def _rows(label: Label) -> list[tuple[Any, ...]]:
    """Text and colours of the rows of a label: what names colours stands in one row."""
    lines = enumerate(zip(label.text, label.colours, strict=True))
    groups = groupby(lines, lambda each: -1 if each[1][0].startswith(NAMED) else each[0])
    return [tuple(zip(*(line for _, line in group), strict=True)) for _, group in groups]


@lru_cache(maxsize=16)
def _label(label: Label, size: tuple[int, int]) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Text on a soft gradient, in the lower left corner of a picture of a size [pixels].

    What is left of the picture under it (h, w, 1), of 256, and what is added (h, w, 3).
    """
    gap = round(_GAP * _scale_of(size))
    left = gap
    rows = _rows(label)
    letters = _scale_of(size) * label.size * np.array([1.0] + [_LESSER] * (len(rows) - 1))
    lengths = np.array([_font(100).getlength(_APART.join(words)) / 100 for words, _ in rows])
    letters = np.minimum(letters, (size[0] - 2 * left) / np.maximum(lengths, 1.0))
    legible = letters >= _LEAST_LETTER
    heights = letters[legible].astype(int).tolist()
    high = sum(round(_LINE * each) for each in heights)
    if not heights or high > _MOST_COVERED * size[1]:
        return np.zeros((0, 0, 1), np.uint16), np.zeros((0, 0, 3), np.uint16)
    wide = float((letters * lengths)[legible].max())
    shape = round(_SHADED * wide), round(_SHADED * high) + gap
    x, y = (np.arange(side) / side for side in shape)
    shade = _DARKEST * np.outer(smoothed(y), (1.0 - x) ** 2 * (1.0 + 2.0 * x))
    kept = 256.0 * (1.0 - shade[..., None])
    # The fourth channel is how much of a pixel the letters cover.
    picture = Image.new("RGBA", shape)
    top = shape[1] - gap - high
    for (words, colours), each in zip(compress(rows, legible), heights, strict=True):
        place = left
        for one, colour in zip(words, colours, strict=True):
            fill = (*colour, 255)
            ImageDraw.Draw(picture).text((place, top), one, font=_font(each), fill=fill)
            place += round(_font(each).getlength(one + _APART))
        top += round(_LINE * each)
    drawn = np.asarray(picture)[-size[1] :, : size[0]]
    covered = drawn[..., 3:] / WHITE
    kept = kept[-size[1] :, : size[0]] * (1.0 - covered)
    return kept.astype(np.uint16), (covered * drawn[..., :3]).astype(np.uint16)


def _lay_label(picture: Pixels, label: Label) -> None:
    """Lay text over the lower left corner of a picture, on a soft gradient."""
    kept, added = _label(label, picture.shape[1::-1])
    if len(kept):
        part = picture[-len(kept) :, : kept.shape[1]]
        part[:] = ((part * kept) >> 8) + added


def _lay_frame(
    picture: Pixels, box: tuple[int, int, int, int], window: InsetView, size: float
) -> None:
    """Frame the inset in a box, left, top, width and height [pixels], which shows a window."""
    left, top, wide, high = box
    rim = max(1, round(_FRAME * size))
    pad = round(0.5 * _GAP * size)
    part = picture[top : top + high, left : left + wide]
    part[:rim] = part[-rim:] = part[:, :rim] = part[:, -rim:] = _FRAME_COLOUR
    # Under the inset, so that it hides nothing of the map.
    letters = round(_BAR_LETTER * size)
    foot = picture[top + high : top + high + letters + pad, left : left + wide]
    middle = len(foot) // 2
    end = foot.shape[1] - pad
    begin = end - round(window.bar / window.width * wide)
    foot[middle - rim : middle + rim, begin:end] = _BAR_COLOUR
    text = Image.fromarray(np.ascontiguousarray(foot[:, :begin]))
    ImageDraw.Draw(text).text(
        (text.width - pad, middle),
        f"{window.bar:g} m",
        font=_font(letters),
        fill=_BAR_COLOUR,
        anchor="rm",
    )
    foot[:, :begin] = np.asarray(text)
