"""Film: the pictures of a run, one for each time asked for, and the options of all films."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.errors import InputError, expect, shown
from lrf3d.geometry import is_finite, number, read_only, whole_number
from lrf3d.render.gl import gl_available, import_libraries, require_gl
from lrf3d.render.hud import GAP, lay_frame, lay_label, scale_of
from lrf3d.run import Run
from lrf3d.scene import panel
from lrf3d.scene.moments import LAYERS, Goal, Scene
from lrf3d.scene.shapes import Pixels
from lrf3d.scene.stage.stage import Stage
from lrf3d.scene.story import make_camera
from lrf3d.scene.timeline import Timeline
from lrf3d.world.cameras import check_view

_INSET, _WIDEST, _LEAST_SIDE = 0.25, 0.34, 30
"""Side of a square as large as the inset, in shorter sides of the picture; its largest width, in
those of the picture, and the least side [pixels]."""


@dataclass(frozen=True, slots=True)
class FilmOptions:
    """How pictures of a run are drawn: see :func:`lrf3d.render_video`."""

    size: tuple[int, int] = (1280, 720)
    view: str | None = None
    playback: float | None = None
    samples: int = 4
    renderer: str | None = None
    panel: str = "short"
    layers: Collection[str] = LAYERS
    """What is drawn over the scene."""
    goal: Goal | None = None
    """A goal to be marked on the ground."""

    def of(self, run: Run) -> "FilmOptions":
        """These options, where the run and the machine choose what is not given.

        Raises:
            InputError: An option is invalid.
            MissingLibraryError: OpenGL is asked for and is not there.
        """
        expect(run, Run, "run")
        view = run.film.view if self.view is None else self.view
        playback = run.playback if self.playback is None else self.playback
        sides = self.size if isinstance(self.size, tuple | list) else ()
        smallest, largest = 16, 8192  # Sides of pictures [pixels] that can be drawn.
        limits = {"least": smallest, "most": largest}
        if len(sides) != 2:
            raise InputError(f"size {shown(self.size)}: expected width and height [pixels]")
        if not isinstance(view, str):
            raise InputError(f"view {shown(view)}: expected the name of a camera")
        check_view(view, run.world.cameras)
        if not (is_finite(self.samples) and self.samples in (0, 4)):
            raise InputError(f"samples {shown(self.samples)}: expected 0 or 4")
        if self.panel not in panel.PANELS:
            found = f"panel {shown(self.panel)}"
            raise InputError(f"{found}: expected one of {', '.join(panel.PANELS)}")
        goal = None if self.goal is None else read_only(self.goal, "goal")
        if goal is not None and (goal.shape != (3,) or not is_finite(*goal)):
            raise InputError(f"goal {shown(self.goal)}: expected x, y and radius [m]")
        width, height = (whole_number(side, "size", **limits) for side in sides)
        return replace(
            self,
            size=(width, height),
            view=view,
            playback=number(playback, "playback", positive=True),
            renderer=choose_renderer(self.renderer),
            layers=frozenset(self.layers),
            goal=None if goal is None else tuple(goal.tolist()),
        )


def choose_renderer(wanted: str | None) -> str:
    """The renderer of a name; where none is named, OpenGL's where it is there, else Embree's."""
    if wanted is None:
        return "gl" if gl_available() else "embree"
    # Names of the renderers: Embree's, which needs nothing but wheels, and OpenGL's, the fast one.
    renderers = ("embree", "gl")
    if wanted not in renderers:
        raise InputError(f"renderer {shown(wanted)}: expected one of {', '.join(renderers)}")
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
        self.timeline = Timeline(run, playback=chosen.playback)
        self.scene = Scene(self.timeline, chosen.goal, stage)
        # Only what the renderer needs is imported.
        self.renderer: Any
        if chosen.renderer == "gl":
            from lrf3d.render.renderer import Renderer

            self.renderer = Renderer(self.scene.stage, chosen.size, chosen.samples)
        else:
            from lrf3d.render.plain import PlainRenderer

            self.renderer = PlainRenderer(self.scene.stage, chosen.size)
        self.camera = make_camera(str(chosen.view), self.timeline, self.scene.structures)
        self._size, self._layers = chosen.size, chosen.layers
        self._full = chosen.panel == "full"
        self._window = self.scene.plan_window()
        wide = _INSET * min(chosen.size) / self._window.aspect**0.5
        wide = round(min(wide, _WIDEST * chosen.size[0]))
        gap, high = round(GAP * scale_of(chosen.size)), round(wide * self._window.aspect)
        self._box = chosen.size[0] - gap - wide, gap, wide, high
        self._key: object = None
        self._picture: Pixels = np.zeros((0, 0, 4), np.uint8)

    def draw(self, time: float) -> Pixels:
        """The picture (h, w, 4) uint8 at a time of the run [s]; the next one writes over it."""
        moment = self.timeline.moment(time)
        view = self.camera.look(time, self._size[0] / self._size[1])
        settled = 4.0  # After the end light still fades, and colours climb [s of the film].
        key = min(moment.now, self.timeline.end + settled * self.timeline.playback), view.key
        if key == self._key:
            # Nothing has moved: the last picture is this one.
            return self._picture
        self._key = key
        seen = self.scene.seen(moment, view, self._size, self._layers)
        inset = view.plan and "inset" in self._layers and min(self._box[2:]) >= _LEAST_SIDE
        if inset:
            seen = seen._replace(plan=self.scene.plan(moment, self._box, self._window))
        self._picture = self.renderer.draw(seen)
        if inset:
            lay_frame(self._picture, self._box, self._window)
        if "hud" in self._layers:
            run, playback = self.timeline.run, self.timeline.playback
            lay_label(self._picture, panel.panel(run, moment, view, playback, full=self._full))
        return self._picture

    def close(self) -> None:
        """Free what the driver holds."""
        self.renderer.close()
