"""Film: the pictures of a run, one for each time asked for."""

from collections.abc import Callable, Collection, Iterable
from types import MappingProxyType
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.render.bindings import pyrender
from lrf3d.render.gl import import_libraries
from lrf3d.render.hud import Hud, widest_lines
from lrf3d.render.inset import Inset
from lrf3d.render.layout import lay_out, scale_of
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import Draw, FrameRenderer
from lrf3d.render.scenery import Frame, Goal, Scenery
from lrf3d.run import Run
from lrf3d.scene.camera import Look
from lrf3d.scene.cameras import make_camera
from lrf3d.scene.stage import Stage
from lrf3d.scene.structures import SIGHT_DISTANCE
from lrf3d.scene.timeline import Moment, Timeline

LAYERS = (
    "shadow", "goal", "trail", "estimate", "fan", "beams", "map", "trace", "points", "marker",
    "inset", "hud",
)  # fmt: skip
"""What can be left out of a film; what is left out costs nothing."""

Layer = Callable[[Frame], Iterable[Draw]]
"""Gives what is drawn of a layer in a frame."""

_PAST_GROUND = 3.0
"""How far an eye far above the ground sees, in its heights: past all of it, at a slant too."""

_SMALL = 0.7
"""Size of the panel, against its usual one, where the whole picture is a map."""

_SLACK = 0.002
"""By how much the depth of marks gains with their distance [m/m], as depths are coarser far away;
but not for an eye that looks from far on purpose."""


class Film:
    """Draws pictures of a run.

    Args:
        run: The run.
        size: Width and height of the pictures [pixels].
        view: Name of the camera.
        samples: Samples a pixel against jagged edges: 4, or 0 for none.
        playback: Seconds of the run in a second of the film, the run's own if not given; cameras
            move by the film's time.
        layers: What is drawn over the scene, of :data:`LAYERS`.
        renderer: What draws: ``gl``, or ``embree`` where there is no OpenGL.
        goal: A goal to be marked on the ground.
        stage: What stands in the run's world, if it has been painted already.
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
    ) -> None:
        self.timeline = Timeline(run, playback=playback)
        self.renderer = _renderer(renderer, size, samples)
        self.scenery = Scenery(self.timeline, goal, stage)
        self.renderer.know(self.scenery.constants)
        small = _SMALL if view == "top" else 1.0
        layout = lay_out(size, widest_lines(run, self.timeline.playback), small)
        self._size = size
        self._solid, self._soft = self._layers(layers)
        covered = layout.covered if "hud" in layers else (0.0, 0.0)
        self.camera = make_camera(view, self.timeline, self.scenery.structures, covered)
        self._scale = scale_of(size)
        self._inset = self._hud = None
        if "inset" in layers and layout.inset is not None:
            self._inset = Inset(self.scenery, size, layout.inset)
        if "hud" in layers and layout.scale is not None:
            played = self.timeline.playback
            self._hud = Hud(self.scenery, size, layout.scale, layout.gap, played)
        lens = pyrender.PerspectiveCamera(yfov=1.0, znear=0.2, zfar=SIGHT_DISTANCE)
        self._eye = self.scenery.scene.add(lens)
        self._shown: tuple[Any, ...] | None = None
        self._picture: Picture = np.zeros((0, 0, 4), np.uint8)

    def draw(self, time: float) -> Picture:
        """The picture (h, w, 4) uint8 at a time of the run [s]; the next one writes over it."""
        moment = self.timeline.moment(time)
        look = self.camera.look(time, self._size[0] / self._size[1])
        words = self._hud.lines(moment) if self._hud is not None else ()
        run = self.scenery.run
        moving = moment.time if run.obstacles or run.estimate is not None else 0.0
        shown = (
            moment.scan,
            moment.scanning,
            moment.pose.tobytes(),
            look.key,
            words,
            moving,
            self.scenery.grown(moment),
        )
        if shown == self._shown:
            # Nothing has moved, no word has changed: the last picture is this one.
            return self._picture
        self._shown = shown
        frame = self._frame(moment, look)
        renderer = self.renderer
        renderer.begin(self.scenery.scene)
        renderer.look_through(frame.camera)
        inset = None if look.shows_map else self._inset
        if inset is not None:
            inset.cover(renderer)
        for layer in self._solid:
            self._draw(layer, frame)
        renderer.flatten()
        for layer in self._soft:
            self._draw(layer, frame)
        if inset is not None:
            inset.draw(renderer, frame)
        if self._hud is not None:
            self._hud.draw(renderer, words)
        self._picture = renderer.finish()
        return self._picture

    def forget(self) -> None:
        """Draw the next picture even where it is the last one again."""
        self._shown = None

    def close(self) -> None:
        """Free what the driver holds."""
        self.renderer.delete()

    def _draw(self, layer: Layer, frame: Frame) -> None:
        """Draw a layer over what there is."""
        for primitive, special in layer(frame):
            self.renderer.draw(primitive, special)

    def _place_camera(self, look: Look) -> tuple[Float, Float]:
        """Look at the scene: the matrix (4, 4) from it to the picture, and the eye (3,)."""
        scene, lens = self.scenery.scene, self._eye.camera
        lens.yfov, lens.znear = look.field, look.near
        lens.zfar = max(SIGHT_DISTANCE, _PAST_GROUND * float(look.eye[2]))
        scene.set_pose(self._eye, look.pose)
        return self.renderer.camera_matrices(scene)

    def _frame(self, moment: Moment, look: Look) -> Frame:
        """All that the layers of a picture share, worked out once."""
        width, height = self._size
        matrix, eye = self._place_camera(look)
        thick = min(self.scenery.thick, 1.0 / max(look.air, 1e-9))
        camera = {
            "view_projection": matrix,
            "eye": tuple(eye.tolist()),
            "thick": 0.0 if look.clear else thick,
            "viewport": (float(width), float(height)),
            "slack": 0.0 if look.clear else _SLACK,
        }
        return Frame(
            moment=moment,
            pose=moment.pose - [*self.scenery.origin, 0.0],
            look=look,
            matrix=matrix,
            eye=eye,
            focus=float(0.5 * height / np.tan(0.5 * look.field)),
            scale=self._scale,
            camera=MappingProxyType(camera),
        )

    def _layers(self, chosen: Collection[str]) -> tuple[list[Layer], list[Layer]]:
        """What is drawn: what hides what is behind it, and what is laid over that, soft-edged.

        Solid things may come in any order; those that hide much come first, to spare pixels.
        """
        scenery = self.scenery

        def draw_map(frame: Frame) -> Iterable[Draw]:
            shown = frame.look.shows_map or frame.look.through
            return scenery.draw_map(frame) if shown else ()

        solid: list[Layer] = [
            scenery.draw_robot,
            scenery.draw_obstacles,
            *((scenery.draw_bands,) if "map" in chosen else ()),
            scenery.draw_walls,
            scenery.draw_ground,
            scenery.draw_sky,
        ]
        soft: list[tuple[str, Layer]] = [
            ("shadow", scenery.draw_shadows),
            ("goal", scenery.draw_goal),
            ("trail", scenery.draw_trail),
            ("map", scenery.draw_glow),
            ("estimate", scenery.draw_estimate),
            ("fan", scenery.draw_fan),
            ("beams", scenery.draw_beams),
            ("map", draw_map),
            ("trace", scenery.draw_trace),
            ("points", scenery.draw_points),
            ("marker", scenery.draw_marker),
        ]
        return solid, [layer for name, layer in soft if name in chosen]


def _renderer(name: str, size: tuple[int, int], samples: int) -> FrameRenderer:
    """The renderer of a name; only what it needs is imported."""
    if name == "embree":
        from lrf3d.render.traced.renderer import TracedRenderer

        return TracedRenderer(*size, samples)
    import_libraries()
    from lrf3d.render.renderer import Renderer

    return Renderer(*size, samples)
