"""Film: the pictures of a run, one for each time asked for."""

from collections.abc import Collection
from typing import Protocol

import numpy as np

from lrf3d.render.gl import import_libraries
from lrf3d.render.hud import gap_of, lay_frame, lay_labels
from lrf3d.run import Run
from lrf3d.scene import panel
from lrf3d.scene.camera import Look
from lrf3d.scene.cameras import make_camera
from lrf3d.scene.moments import LAYERS, Goal, Scene
from lrf3d.scene.shapes import Label, Pixels, Seen
from lrf3d.scene.stage import Stage
from lrf3d.scene.timeline import Moment, Timeline

_SIDE, _LEAST_SIDE = 0.30, 40
"""Side of the inset, as a share of the shorter side of the picture, and the least [pixels]."""


class Renderer(Protocol):
    """Draws what is to be seen."""

    def draw(self, seen: Seen) -> Pixels:
        """The picture (h, w, 4) uint8; the next one writes over it."""
        ...

    def close(self) -> None:
        """Free what is held."""
        ...


class Film:
    """Draws pictures of a run.

    Args:
        run: The run.
        size: Width and height of the pictures [pixels].
        view: Name of the camera.
        samples: Samples a pixel against jagged edges: 4, or 0 for none.
        playback: Seconds of the run in a second of the film, the run's own if not given; cameras
            move by the film's time.
        layers: What is drawn over the scene, of :data:`~lrf3d.scene.moments.LAYERS`.
        renderer: What draws: ``gl``, or ``embree`` where there is no OpenGL.
        goal: A goal to be marked on the ground.
        stage: What stands in the run's world, if it has been painted already.
        panel: What the panel says: ``short``, three facts, or ``full``, all numbers.
    """

    def __init__(
        self,
        run: Run,
        *,
        size: tuple[int, int],
        view: str,
        samples: int,
        playback: float | None = None,
        layers: Collection[str] = LAYERS,
        renderer: str = "gl",
        goal: Goal | None = None,
        stage: Stage | None = None,
        panel: str = "short",
    ) -> None:
        self.timeline = Timeline(run, playback=playback)
        if renderer == "gl":
            # Before anything is painted, which takes seconds.
            import_libraries()
        self.scene = Scene(self.timeline, goal, stage)
        self.renderer = _renderer(renderer, self.scene.stage, size, samples)
        self.camera = make_camera(view, self.timeline, self.scene.structures)
        self._size, self._layers = size, frozenset(layers)
        self._facts = _facts(self.scene, panel)
        self._side = round(_SIDE * min(size))
        self._middle, self._window = self.scene.plan_window()
        self._key: object = None
        self._picture: Pixels = np.zeros((0, 0, 4), np.uint8)

    def draw(self, time: float) -> Pixels:
        """The picture (h, w, 4) uint8 at a time of the run [s]; the next one writes over it."""
        moment = self.timeline.moment(time)
        view = self.camera.look(time, self._size[0] / self._size[1])
        if (moment.time, view.key) == self._key:
            # Nothing has moved: the last picture is this one.
            return self._picture
        self._key = (moment.time, view.key)
        seen = self.scene.seen(moment, view, self._size, self._layers)
        inset = view.plan and "inset" in self._layers and self._side >= _LEAST_SIDE
        gap = gap_of(self._size)
        left = self._size[0] - gap - self._side
        if inset:
            box = (left, gap, self._side)
            plan = self.scene.plan(moment, box, self._middle, self._window)
            seen = seen._replace(plan=plan)
        if "hud" in self._layers:
            seen = seen._replace(labels=self._labels(moment, view))
        self._picture = self.renderer.draw(seen)
        if inset:
            lay_frame(self._picture, (left, gap, self._side), self._window)
        lay_labels(self._picture, seen.labels, self._side if inset else 0)
        return self._picture

    def forget(self) -> None:
        """Draw the next picture even where it is the last one again."""
        self._key = None

    def close(self) -> None:
        """Free what the driver holds."""
        self.renderer.close()

    def _labels(self, moment: Moment, view: Look) -> tuple[Label, ...]:
        said = panel.panel(self._facts, moment, view.shot)
        return (said, panel.card(self._facts)) if view.raised >= 1.0 else (said,)


def _facts(scene: Scene, wanted: str) -> panel.Facts:
    return panel.Facts(scene.run, scene.structures, scene.timeline.playback, wanted)


def _renderer(name: str, stage: Stage, size: tuple[int, int], samples: int) -> Renderer:
    """The renderer of a name; only what it needs is imported."""
    if name == "embree":
        from lrf3d.render.plain import PlainRenderer

        return PlainRenderer(stage, size)
    from lrf3d.render.renderer import Renderer

    return Renderer(stage, size, samples)
