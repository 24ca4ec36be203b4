"""Film: the pictures of a run, one for each time asked for."""

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.render.bindings import pyrender
from lrf3d.render.gl import import_libraries
from lrf3d.render.hud import Hud, widest_lines
from lrf3d.render.inset import Inset
from lrf3d.render.layout import lay_out, scale_of
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import Canvas, Primitive
from lrf3d.render.scenery import Scenery
from lrf3d.run import Run
from lrf3d.scene.camera import Look, make_camera
from lrf3d.scene.look import POINT_PIXELS, POINT_SIZE, TRAIL_WIDTH
from lrf3d.scene.sight import FARTHEST
from lrf3d.scene.timeline import Timeline

LAYERS = ("shadow", "trail", "fan", "beams", "trace", "points", "inset", "hud")
"""What can be left out of a film; what is left out costs nothing."""


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
    ) -> None:
        self.timeline = Timeline(run, playback=playback)
        self.renderer = _renderer(renderer, size, samples)
        self.scenery = Scenery(self.timeline)
        layout = lay_out(size, widest_lines(run))
        self._size = size
        self._layers = frozenset(layers)
        covered = layout.covered if "hud" in self._layers else (0.0, 0.0)
        self.camera = make_camera(view, self.timeline, self.scenery.structures, covered)
        self._scale = scale_of(size)
        self._inset = self._hud = None
        if "inset" in self._layers and layout.inset is not None:
            self._inset = Inset(self.scenery, size, layout.inset)
        if "hud" in self._layers and layout.scale is not None:
            self._hud = Hud(self.scenery, size, layout.scale, layout.gap)
        lens = pyrender.PerspectiveCamera(yfov=1.0, znear=0.2, zfar=FARTHEST)
        self._eye = self.scenery.scene.add(lens)
        self._shown: tuple[Any, ...] | None = None
        self._picture: Picture = np.zeros((0, 0, 4), np.uint8)

    def draw(self, time: float) -> Picture:
        """The picture (h, w, 4) uint8 at a time of the run [s]; the next one writes over it."""
        moment = self.timeline.moment(time)
        width, height = self._size
        look = self.camera.look(time, width / height)
        words = self._hud.lines(moment) if self._hud is not None else ()
        moving = time if self.scenery.run.obstacles else 0.0
        shown = (moment.scan, moment.scanning, moment.pose.tobytes(), look.key, words, moving)
        if shown == self._shown:
            # Nothing has moved, no word has changed: the last picture is this one.
            return self._picture
        self._shown = shown
        self._eye.camera.yfov, self._eye.camera.znear = look.field, look.near
        self._eye.camera.zfar = max(FARTHEST, 3.0 * float(look.eye[2]))
        self.scenery.scene.set_pose(self._eye, look.pose)
        matrix, eye = self.renderer.camera_matrices(self.scenery.scene)
        # What comes into sight is put into the scene before the scene is uploaded.
        down = np.tan(0.5 * look.field) * float(eye[2]) * max(1.0, width / height)
        self.scenery.look_from(matrix, eye, float(down) if look.clear else 0.0)
        self.renderer.begin(self.scenery.scene)
        # Pixels that a metre takes at a distance of one metre.
        focus = 0.5 * height / np.tan(0.5 * look.field)
        metre = focus / float(np.linalg.norm(look.eye - look.target))
        shared: dict[str, Any] = {
            **self.scenery.show(moment),
            "view_projection": matrix,
            "eye": tuple(eye.tolist()),
            "viewport": (float(width), float(height)),
            "half_width": max(0.5 * TRAIL_WIDTH, 1.2 * self._scale / metre),
            "focus": float(focus),
            "sizes": (POINT_SIZE, *(self._scale * size for size in POINT_PIXELS)),
        }
        shared["strength"] *= look.fan
        # Depths are coarser far away, but not for an eye that looks from far on purpose.
        shared["slack"] = 0.0 if look.clear else 0.002
        if look.clear:
            shared["haze"] = (*shared["haze"][:3], 0.0)
        for primitive, special in self._solid(look, matrix):
            self.renderer.draw(primitive, {**shared, **special})
        self.renderer.flatten()
        # The driver's threads draw the solids meanwhile.
        self.scenery.show_seen(moment)
        for primitive, special in self._translucent(look):
            self.renderer.draw(primitive, {**shared, **special})
        if self._inset is not None and not look.shows_map:
            self._inset.draw(self.renderer, moment, shared)
        if self._hud is not None:
            self._hud.draw(self.renderer, words)
        self._picture = self.renderer.finish()
        return self._picture

    def forget(self) -> None:
        """Draw the next picture even where it is the last one again."""
        self._shown = None

    def close(self) -> None:
        """Free what the driver holds."""
        self.renderer.delete()

    def _solid(self, look: Look, matrix: Float) -> Iterator[tuple[Primitive, dict[str, Any]]]:
        """What hides what is behind it, in order: first what hides much, the sky last."""
        scenery = self.scenery
        yield scenery.robot, {}
        yield from scenery.movers.bodies()
        yield scenery.walls.faces, {}
        yield from scenery.ground.draws()
        horizon = look.horizon
        if horizon < 1.0:
            # The picture is drawn upside down, so that the sky begins at the row of −1.
            band = (-1.0, -max(horizon, -1.0))
            yield scenery.sky, {"band": band, "ray_from_corner": np.linalg.inv(matrix)}

    def _translucent(self, look: Look) -> Iterator[tuple[Primitive, dict[str, Any]]]:
        """What is laid over the scene, with soft edges of its own."""
        scenery, on = self.scenery, self._layers
        if "shadow" in on:
            yield scenery.blob, {}
            yield from scenery.movers.shades()
        if "trail" in on:
            yield scenery.trail, {}
        if "fan" in on:
            yield scenery.fan, {}
        if "beams" in on:
            yield scenery.lines, {"width": 1.1 * self._scale, "nearer": 0.02}
        # Seen from straight above, the tops of walls would hide the map and the points on them.
        over = 1e6 if look.shows_map else 0.12
        if look.shows_map:
            yield scenery.map, {"width": 4.0 * self._scale, "nearer": over}
        if "trace" in on:
            yield scenery.trace, {"width": 2.2 * self._scale, "nearer": over}
        if "points" in on:
            yield scenery.dots, {"nearer": over}


def _renderer(name: str, size: tuple[int, int], samples: int) -> Canvas:
    """The renderer of a name; only what it needs is imported."""
    if name == "embree":
        from lrf3d.render.traced.renderer import TracedRenderer

        return TracedRenderer(*size, samples)
    import_libraries()
    from lrf3d.render.renderer import Renderer

    return Renderer(*size, samples)
