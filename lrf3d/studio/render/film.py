"""Film: the pictures of a run, one for each time asked for, and the options of all films.

Text stands in a band under what a renderer draws, and maps in a strip beside both.
"""

from collections.abc import Collection, Mapping
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.latest import Latest
from lrf3d.geometry.lines import is_finite, number, read_only, whole_number
from lrf3d.simulation.run import Run
from lrf3d.studio.render.beside import Comparison, MapBeside, together
from lrf3d.studio.render.gl import gl_available, import_libraries, require_gl
from lrf3d.studio.render.text import (
    LETTER,
    LINE,
    band_of,
    banded,
    gap_of,
    lay_pins,
    scale_of,
    stacked,
)
from lrf3d.studio.scene import panel
from lrf3d.studio.scene.bodies import robots_of
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.look import FALSE_COLOUR, PALE_WALL, PLAN_BACK, SIZE, TRAIL_COLOUR, Colour
from lrf3d.studio.scene.moments import LAYERS, Goal, Scene
from lrf3d.studio.scene.shapes import NAMED, Label, Pixels
from lrf3d.studio.scene.shots import FIRST_SHOT, LENGTH, LONGEST, SHORTEST, SHOTS
from lrf3d.studio.scene.stage.stage import Stage
from lrf3d.studio.scene.story import Story
from lrf3d.studio.scene.subject import subject_of
from lrf3d.studio.scene.timeline import Moment, Timeline
from lrf3d.studio.scene.views import make_camera, margin
from lrf3d.world.cameras import check_view

# Time past its end at which a run can still be shown [s], as sums of steps are rounded.
SLACK = 1e-6

# Smallest side of a picture [pixels].
_SMALLEST = 16

# Largest side of a picture [pixels], which graphics cards still draw.
_LARGEST = 8192

# Time that the drive of a short run takes, if it is not slower than it was [s of the film].
_LEAST_DRIVE = 8.0

# Width of the strip with the map, in that of the picture.
_WIDEST = 0.27

# Least width of the map, of which a smaller one is left out [pixels].
_LEAST_SIDE = 30

# How much faster the strip fades than it leaves.
_FADES = 4.0

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
    # What is said of maps that are compared.
    title: str = ""
    # Whether a story says where it is fast forward: a single picture or a part does not.
    rushes: bool = True

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
            # It shows only parts of a long run, at the usual speed, and a short one more slowly.
            slower = max(1.0, run.trajectory.duration / _LEAST_DRIVE)
            playback = min(run.film.playback_of(0.0), slower)
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

    The options are those of :class:`FilmOptions`. If given, the maps of several robots' runs, by
    their names, stand beside the picture, the run's own first. Those that are compared take its
    place when a story has opened.
    """

    def __init__(
        self,
        run: Run,
        *,
        stage: Stage | None = None,
        maps: Mapping[str, tuple[Run, Stage]] = MappingProxyType({}),
        compared: Mapping[str, tuple[Run, Stage]] = MappingProxyType({}),
        **options: Any,
    ) -> None:
        chosen = FilmOptions(**options).of(run)
        if chosen.renderer == "gl":
            # Before anything is painted, which takes seconds.
            import_libraries()
        self.run = run
        self.timeline = Timeline(run, playback=chosen.playback)
        # Each of several robots has the colour of its trail; else found walls are pale.
        colours = [TRAIL_COLOUR, *(colour for _, colour in robots_of(run.obstacles))]
        team: dict[Any, Any] = {
            each: colour for (each, _), colour in zip(maps.values(), colours, strict=False)
        }
        self.scene = Scene(self.timeline, chosen.goal, stage, team=team)
        self._layers = chosen.layers
        self._full = chosen.panel == "full"

        def made(each: Run, painted: Stage) -> Scene:
            timeline = Timeline(each, playback=chosen.playback)
            return Scene(timeline, None, painted, team={each: team.get(each, PALE_WALL)})

        self._scenes, others = (
            {name: made(each, painted) for name, (each, painted) in some.items()}
            for some in (maps, compared)
        )
        self._comparison = Comparison(others, chosen.size, chosen.title)
        self.scene.judged = self._comparison.named
        room = self._lay_out(chosen)
        self.maps = self._maps_in(room, chosen, colours)
        # Width of the strip with the map [pixels], in which nothing else is drawn.
        self._strip = bool(self.maps) * (not others) * (room[0] + 2 * self._gap)
        width, height = chosen.size
        # Height of the band of text under the picture [pixels].
        self._band = band_of(chosen.size) * ("hud" in chosen.layers)
        # The scene has the rest of the height.
        self._size = width, height - self._band
        self.renderer = _renderer(self.scene.stage, self._size, chosen)
        # What shows one map draws it, too; of several, each is on what its own robot has seen.
        self._drawers = [
            _renderer(each.stage, chosen.size, chosen) for each in (others or self._scenes).values()
        ] or [self.renderer]
        self.camera = make_camera(str(chosen.view), self.timeline, self.scene.stage, chosen.length)
        if isinstance(self.camera, Story):
            self.camera.rushes = chosen.rushes
            self.camera.names = [*self._scenes]
            # The maps of several robots stay, and so does what is magnified.
            magnified = subject_of(run, self.timeline.playback).magnified
            self.camera.widens = (not self._scenes) * (not magnified) * width / self._size[1]

    def _lay_out(self, chosen: FilmOptions) -> tuple[int, int]:
        """Choose the letters and the gaps round maps; the room for one of them [pixels]."""
        width, height = chosen.size
        self._gap = gap_of(chosen.size)
        self._scale = scale_of(chosen.size)
        self._letter = self._scale * LETTER
        head = round(LINE * self._letter) + self._gap
        # Each map has a name and a number; a legend and a scale stand under all.
        count = max(1, len(self._scenes))
        high = height // count - (count + 2) * (2 * head - self._gap) // count
        return round(_WIDEST * width) - 2 * self._gap, high

    def _maps_in(
        self, room: tuple[int, int], chosen: FilmOptions, colours: list[Colour]
    ) -> list[MapBeside]:
        """The maps beside the picture, in a room for each; none if it is too small."""
        if "inset" not in chosen.layers or min(room) < _LEAST_SIDE:
            return []
        walls = colours if self._scenes else [PALE_WALL]
        named = self._scenes or {"": self.scene}
        return [
            MapBeside(scene, room, self._letter, name, pair)
            for (name, scene), *pair in zip(named.items(), walls, colours, strict=False)
        ]

    def draw(self, time: float) -> Pixels:
        """The picture (h, w, 3) uint8 at a time of the run [s]."""
        moment = self.timeline.moment(time)
        view = self._view(time)
        if view.shot != FIRST_SHOT and time < self._comparison.until:
            return self._comparison.picture(time, [each.plan for each in self._drawers])
        seen = self.scene.seen(moment, view, self._size, self._layers)
        # What is left of the picture; the strip leaves it to the right.
        width, _ = self._size
        columns = width - round(view.inset * self._strip)
        shine = [mark for each in [*self._scenes.values()][1:] for mark in each.shine(time)]
        frames = [mark for each in self.maps for mark in each.frame(time)]
        seen = seen._replace(columns=columns, marks=(*seen.marks, *shine, *frames))
        picture: Pixels = self.renderer.draw(seen)
        if self._band:
            pins = self.scene.pins(view, self._size)
            lay_pins(picture, pins, seen.lens, panel.whole(FALSE_COLOUR))
            room = columns, self._band
            text = banded(self._label(moment, view), room, self._scale)
            picture = np.vstack([picture, text])
        return picture if columns == width else self._beside(picture, time, view.inset)

    def _label(self, moment: Moment, view: Look) -> Label:
        """The text of a moment, of several robots with what their maps hold."""
        words = together(self._scenes, moment.time) if self._scenes else self._comparison.card()
        heads = {FIRST_SHOT: self._comparison.title}
        heads |= dict.fromkeys(("rise", "whole"), words[0])
        heads |= dict.fromkeys(SHOTS, words[(1 + view.robot) % len(words)])
        if head := heads.get(view.shot):
            which = [f"here: {each.name}" for each in self._comparison.maps[:1]]
            view = replace(view, said=(head, *which, *view.said[1:]))
        label = panel.panel(
            self.run,
            moment,
            view,
            self.timeline.playback,
            full=self._full,
            robots=tuple(self._scenes),
        )
        if any(words) and panel.has_card(self.run, moment, view):
            head, *found = words
            colours = [panel.PALE] * len(found)
            if self._scenes:
                # What each robot has found is in its colour.
                found = [f"{NAMED} {each}" for each in found]
                colours = [panel.whole(each or PALE_WALL) for each in self.scene.team.values()]
            label = label._replace(text=(head, *found), colours=(panel.INK, *colours))
        return label

    def _beside(self, picture: Pixels, time: float, left: float) -> Pixels:
        """A picture (h, w, 3) with the maps of a time [s] in what is left of the strip, 0…1."""
        maps = zip(self.maps, self._drawers, strict=True)
        rows = [row for each, renderer in maps for row in each.rows(time, renderer.plan)]
        width, _ = self._size
        room = self._strip, picture.shape[0]
        strip = stacked([*rows, *self.maps[0].legend(time)], room, self._gap)
        # What leaves the picture leaves it to the right, and fades before it is cut.
        share = max(1.0 - _FADES * (1.0 - left), 0.0)
        faded = PLAN_BACK + share * (strip - np.array(PLAN_BACK))
        return np.hstack([picture, faded.round().astype(np.uint8)[:, : width - picture.shape[1]]])

    def _view(self, time: float) -> Look:
        """The look at a time, in what the strip of the map leaves of the picture."""
        width, height = self._size
        view = self.camera.look(time, (width - self._strip) / height)
        if not view.inset:
            return self.camera.look(time, width / height)
        return replace(view, aside=view.inset * self._strip / width)

    def close(self) -> None:
        """Free what the driver holds."""
        for each in {self.renderer, *self._drawers}:
            each.close()


def _renderer(stage: Stage, size: tuple[int, int], options: FilmOptions) -> Any:
    """What draws a stage; only what it needs is imported."""
    if options.renderer == "gl":
        from lrf3d.studio.render.renderer import Renderer

        return Renderer(stage, size, options.samples)
    from lrf3d.studio.render.plain import PlainRenderer

    return PlainRenderer(stage, size)


def frame(run: Run, time: float, **options: Any) -> NDArray[np.uint8]:
    """The picture (h, w, 3) of a run at a time, with a goal x, y, radius [m]: see `Run.frame`."""
    chosen = FilmOptions(**options, rushes=False).of(run)
    if not is_finite(time):
        raise InputError(f"time {shown(time)}: expected a finite number of seconds")
    timeline = Timeline(run, playback=chosen.playback)
    first = timeline.start
    # The pictures of the end can be drawn, too.
    last = timeline.end + timeline.playback * margin(str(chosen.view))
    # Checked before anything is painted, which takes seconds.
    if not first - SLACK <= time <= last + SLACK:
        raise InputError(f"time {time:g} s: pictures go from {first:g} to {last:g} s")
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
