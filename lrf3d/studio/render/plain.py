"""The plain renderer, for machines without OpenGL: triangles, and rays of Embree past mirrors.

It draws the same values as OpenGL does, with one sample a pixel, and nothing of what
shaders add to them, such as shine.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.casting.triangle_rays import TriangleRays
from lrf3d.geometry.lines import LEFT, Float, Single
from lrf3d.studio.render import fill
from lrf3d.studio.scene import look
from lrf3d.studio.scene.camera import NEAR
from lrf3d.studio.scene.shapes import (
    MIRROR_GAP,
    ON_TOP,
    Inset,
    Lens,
    Lines,
    Mark,
    Pixels,
    Points,
    PosedFaces,
    Reflection,
    Seen,
    Soft,
    Tints,
    reflections,
    single,
)  # fmt: skip
from lrf3d.studio.scene.stage.stage import Stage

# Offset of translucent faces towards the eye from what they lie on [m].
_LIFTED = 0.02

# Depth at which what reaches behind the eye is cut off [m]: a little past the near plane.
_CUT = 1.01 * NEAR

# Least depth that is divided by [m].
_LEAST_DEPTH = 1e-3

# One over the depth of pixels over which nothing is drawn [1/m].
_NEAREST = 1e9

# Share of fresh light in the inset's colour of what was just seen.
_HOT = 0.55


class _Framebuffer(NamedTuple):
    """A picture in the making."""

    # (h, w, 3) colours.
    colours: Single
    # (h, w) one over the depth of what is there [1/m].
    near: Single


class PlainRenderer:
    """Draws what is to be seen of a stage into pictures of a size [pixels]."""

    def __init__(self, stage: Stage, size: tuple[int, int]) -> None:
        self._size = size
        self._scale = look.scale(size, look.LEAST_SCALE)
        quads = np.concatenate(stage.faces[:4], axis=2)
        self._corners = single(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 13))
        self._cut = np.inf
        self._rays = TriangleRays(single(self._corners[..., :3]))
        setting = stage.structures.setting
        ground = stage.ground
        self._surfaces = fill.Surfaces(
            self._corners,
            *_texels(ground.picture),
            np.array([*ground.corner, *ground.size, *ground.land]),
            np.array([look.HAZE, look.ZENITH, look.NIGHT_HIGH, setting.cool]),
            setting.top,
            np.inf,
        )
        times = stage.exposure.texels
        self._mirrors = stage.mirrors
        self._laser = fill.LaserLight(
            times, np.zeros_like(times), np.array(stage.exposure.area), np.zeros(2)
        )
        self._tinted: Tints | None = None

    def draw(self, seen: Seen) -> Pixels:
        """The picture (h, w, 3) uint8 of what is to be seen."""
        lens = seen.lens
        ways = _ways(lens, self._size)
        self._laser = self._laser._replace(clock=np.array(seen.clock))
        self._tint(seen.tints)
        if seen.cut != self._cut:
            self._cut, corners = seen.cut, self._corners.copy()
            corners[..., 2] = np.minimum(corners[..., 2], seen.cut)
            self._surfaces = self._surfaces._replace(corners=corners, cut=seen.cut)
            self._rays = TriangleRays(single(corners[..., :3]))
        tones = self._surfaces.tones
        night = np.array(look.NIGHT_HIGH)
        tones[2] = night + seen.dusk * (look.DUSK - night)
        canvas = self._look(lens, ways, None)
        for reflection in reflections(seen, self._mirrors):
            self._reflect(seen, reflection, canvas, ways)
        for _, body in seen.bodies:
            self._draw_body(canvas, lens, body)
        for _, mark in seen.marks:
            self._draw_mark(canvas, lens, mark)
        return _read(canvas)[:, : seen.columns or None]

    def plan(self, plan: Inset, size: tuple[int, int]) -> Pixels:
        """The picture (h, w, 3) uint8 of a map, of a size [pixels]."""
        self._laser = self._laser._replace(clock=np.array(plan.clock))
        canvas = _Framebuffer(self._explored(plan.lens, size), np.zeros(size[::-1], np.float32))
        for _, mark in plan.marks:
            self._draw_mark(canvas, plan.lens, mark)
        return _read(canvas)

    def _tint(self, tints: Tints | None) -> None:
        if tints is self._tinted:
            return
        self._tinted = tints
        found = np.zeros_like(self._laser.tints)
        if tints is not None:
            # Their lines are of a width in cells, whatever the size of the picture.
            lines = tints.lines._replace(width=tints.lines.width / self._scale)
            shape = found.shape[:2]
            canvas, cover = (
                _Framebuffer(np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32))
                for _ in "ab"
            )
            self._draw_lines(canvas, tints.lens, lines)
            self._draw_lines(cover, tints.lens, lines._replace(colours=lines.colours * 0.0 + 1.0))
            found = np.dstack([canvas.colours, cover.colours[..., :1]])
        self._laser = self._laser._replace(tints=found)

    def _look(self, lens: Lens, ways: Single, starts: Single | None) -> _Framebuffer:
        """What rays of directions (n, 3) see of what stands, from the eye or from their starts."""
        fixed = np.array([*lens.eye, lens.focus, lens.thick])
        if starts is None:
            met = np.full(self._size[::-1], -1, np.int32)
            depths = np.zeros(met.shape, np.float32)
            fill.number_nearest(self._surfaces.corners, lens.matrix[[0, 1, 3]], met, depths)
            hits = met.ravel()
        else:
            hits = self._rays.first(starts, ways)
        found, depth = fill.shade(ways, hits, fixed, self._surfaces, self._laser)
        shape = self._size[::-1] if len(ways) == self._size[0] * self._size[1] else (len(ways), 1)
        return _Framebuffer(found.reshape(*shape, 3), depth.reshape(shape))

    def _reflect(
        self, seen: Seen, reflection: Reflection, canvas: _Framebuffer, ways: Single
    ) -> None:
        x, y, *along = reflection.uniforms["mirror"]
        length, *_ = reflection.uniforms["mirror_size"]
        near = canvas.near.ravel()
        places = seen.lens.eye + ways / np.maximum(near, look.TINY)[:, None]
        there, off = ((places[:, :2] - [x, y]) @ np.column_stack([along, along @ LEFT])).T
        mirrored = (np.abs(off) < MIRROR_GAP) & (there >= 0.0) & (there <= length) & (near > 0.0)
        chosen = np.flatnonzero(mirrored)
        turned = single(ways[chosen] @ reflection.turn[:3, :3])
        starts = single(places[chosen] + MIRROR_GAP * turned)
        shown = self._look(reflection.lens, turned, starts)
        whole = _Framebuffer(np.zeros_like(canvas.colours), np.full_like(canvas.near, _NEAREST))
        whole.colours.reshape(-1, 3)[chosen] = shown.colours.reshape(-1, 3)
        whole.near.ravel()[chosen] = shown.near.ravel()
        for _, body in seen.bodies:
            self._draw_body(whole, reflection.lens, body)
        tinted = whole.colours.reshape(-1, 3)[chosen] * np.array(look.REFLECTED, np.float32)
        canvas.colours.reshape(-1, 3)[chosen] = tinted

    def _explored(self, lens: Lens, size: tuple[int, int]) -> Single:
        across, down = (2.0 * (np.arange(side) + 0.5) / side - 1.0 for side in size)
        pixels = np.stack(np.meshgrid(across, down), axis=-1) - lens.matrix[:2, 3]
        places = pixels @ np.linalg.inv(lens.matrix[:2, :2]).T
        laser = self._laser
        size_of = np.array(laser.times.shape[1::-1])
        cells = (places - laser.area[:2]) * laser.area[2:] * size_of
        columns, rows = np.moveaxis(np.clip(cells, 0, size_of - 1).astype(int), -1, 0)
        when = laser.times[rows, columns]
        age = (laser.clock[0] - when[..., 0]) * laser.clock[1] - when[..., 3]
        on = when[..., 1] * np.clip(age / look.DAWN, 0.0, 1.0)
        hot = (_HOT / (1.0 + 2.0 * age**2))[..., None]
        seen = look.EXPLORED + hot * (np.array(look.EMBER) - look.EXPLORED)
        back = np.array(look.PLAN_BACK) / look.WHITE
        return single(back + on[..., None] * (seen - back))

    def close(self) -> None:
        """Nothing is held that needs to be freed."""

    def _draw_body(self, canvas: _Framebuffer, lens: Lens, body: PosedFaces) -> None:
        faces = body.faces
        turn = body.pose[:3, :3]
        colours = np.insert(faces.colours, 3, 1.0, axis=2)
        self._fill(canvas, lens, faces.corners @ turn.T + body.pose[:3, 3], colours, 0.0, True)

    def _draw_mark(self, canvas: _Framebuffer, lens: Lens, mark: Mark) -> None:
        if isinstance(mark, Soft):
            nearer = ON_TOP if lens.nearer == ON_TOP else _LIFTED
            shown = canvas._replace(near=np.zeros_like(canvas.near)) if mark.on_top else canvas
            self._fill(shown, lens, mark.corners, mark.colours, nearer, False)
        elif isinstance(mark, Points):
            self._draw_points(canvas, lens, mark)
        else:
            self._draw_lines(canvas, lens, mark)

    def _fill(
        self,
        canvas: _Framebuffer,
        lens: Lens,
        corners: Any,
        colours: Any,
        nearer: float,
        solid: bool,
    ) -> None:
        shown = _before_eye(np.dstack([corners, colours]), lens).reshape(-1, 7)
        clip, near = _projected(shown[:, :3], lens, nearer, canvas)
        rows = np.column_stack([clip[:, :2], near, shown[:, 3:]]).reshape(-1, 3, 7)
        fill.fill_triangles(rows, solid, canvas.colours, canvas.near)

    def _draw_points(self, canvas: _Framebuffer, lens: Lens, points: Points) -> None:
        clip, near = _projected(points.places, lens, lens.nearer, canvas)
        low, high = (self._scale * size for size in points.pixels)
        size = np.clip(points.size * lens.focus / np.maximum(clip[:, 2], NEAR), low, high)
        rows = np.column_stack([clip[:, :2], near, size, points.colours])
        # What lies on a thin wall is seen from the side that it faces, or from far above.
        faces = ((lens.eye - points.places)[:, :2] * points.sides).sum(axis=1) >= 0.0
        shown = (clip[:, 2] > NEAR) & (faces | (lens.nearer == ON_TOP))
        fill.fill_discs(rows[shown], canvas.colours, canvas.near)

    def _draw_lines(self, canvas: _Framebuffer, lens: Lens, lines: Lines) -> None:
        ends = np.stack([lines.starts, lines.ends]).astype(float)
        depths = ends @ lens.matrix[3, :3] + lens.matrix[3, 3]
        # What lies behind the eye is cut off.
        apart = np.where(depths[1] == depths[0], 1.0, depths[1] - depths[0])
        cut = ends[0] + ((_CUT - depths[0]) / apart)[:, None] * (ends[1] - ends[0])
        ends = np.where((depths < NEAR)[..., None], cut, ends)
        drawn = [_projected(end, lens, lens.nearer, canvas) for end in ends]
        way = (drawn[1][0] - drawn[0][0])[:, :2]
        across = way @ LEFT
        across /= np.maximum(np.hypot(*way.T), look.TINY)[:, None]
        wide = max(lines.width * self._scale, 1.0)
        thick = lines.thick * lens.focus
        corners = []
        for (place, near), opacity in zip(drawn, lines.opacities.T, strict=True):
            half = 0.5 * np.maximum(wide, thick / place[:, 2:]) * across
            for side in (half, -half):
                corners.append(np.column_stack((place[:, :2] + side, near, lines.colours, opacity)))
        triangles = np.stack([corners[k] for k in (0, 1, 3, 0, 3, 2)], axis=1).reshape(-1, 3, 7)
        shown = np.repeat(depths.max(axis=0) > NEAR, 2)
        fill.fill_triangles(triangles[shown], False, canvas.colours, canvas.near)


def _read(canvas: _Framebuffer) -> Pixels:
    """The picture (h, w, 3) in whole numbers."""
    np.clip(canvas.colours, 0.0, 1.0, out=canvas.colours)
    return np.asarray(look.WHITE * canvas.colours + np.float32(0.5)).astype(np.uint8)


def _before_eye(triangles: Float, lens: Lens) -> Float:
    """Triangles (t, 3, 3 + k), whose columns begin with places, cut off behind the eye."""
    depths = triangles[..., :3] @ lens.matrix[3, :3] + lens.matrix[3, 3] - _CUT
    front = depths > 0.0
    found = [triangles[front.all(axis=1)]]
    for ahead in (1, 2):
        # The corner that is alone on its side of the plane comes first.
        cut = np.flatnonzero(front.sum(axis=1) == ahead)
        order = (np.argmax(front[cut] == (ahead == 1), axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(triangles[cut], order[..., None], axis=1).transpose(1, 0, 2)
        alone, *others = np.take_along_axis(depths[cut], order, axis=1).T[..., None]
        left, right = (
            a + alone / (alone - depth) * (end - a)
            for depth, end in zip(others, (b, c), strict=True)
        )
        shown = [(a, left, right)] if ahead == 1 else [(left, b, c), (left, c, right)]
        found += [np.stack(corners, axis=1) for corners in shown]
    return np.concatenate(found)


def _ways(lens: Lens, size: tuple[int, int]) -> Single:
    """Directions (n, 3) of the rays through all pixels of a picture, scaled to a depth of 1 m."""
    inverse = np.linalg.inv(lens.matrix)

    def ray(x: float, y: float) -> Float:
        far = inverse @ np.array([x, y, 1.0, 1.0])
        way = far[:3] / far[3] - lens.eye
        return np.asarray(way / (lens.matrix[3, :3] @ way), np.float32)

    corner = ray(-1.0, -1.0)
    across = (ray(1.0, -1.0) - corner) / size[0]
    down = (ray(-1.0, 1.0) - corner) / size[1]
    rows, columns = (np.arange(side, dtype=np.float32) + 0.5 for side in size[::-1])
    # Whole rows at a time: NumPy adds long rows some times faster than threes.
    first = (corner + columns[:, None] * across).ravel()
    ways = np.multiply.outer(rows, np.tile(down, size[0]))
    ways += first
    return single(ways.reshape(-1, 3))


def _projected(places: Any, lens: Lens, nearer: float, canvas: _Framebuffer) -> tuple[Float, Float]:
    """x, y [pixels] and depth [m] (n, 3) of places (n, 3), and one over the depth to test (n,).

    That is the depth of points which are nearer to the eye by a distance [m].
    """
    height, width = canvas.near.shape
    clip = places @ lens.matrix[[0, 1, 3], :3].T + lens.matrix[[0, 1, 3], 3]
    clip[:, :2] = (0.5 + 0.5 * clip[:, :2] / np.maximum(clip[:, 2:], _LEAST_DEPTH)) * [
        width,
        height,
    ]
    ray = lens.eye - places
    away = np.linalg.norm(ray, axis=1)
    step = np.minimum(nearer + lens.slack * away, 0.5 * away) / np.maximum(away, look.TINY)
    return clip, 1.0 / np.maximum(clip[:, 2] + step * (ray @ lens.matrix[3, :3]), _LEAST_DEPTH)


def _texels(picture: Pixels) -> tuple[Pixels, NDArray[np.int64]]:
    """All texels of a picture and of copies of it, each half as wide and high as the one before.

    Returns also the start, width and height (n, 3) of each of these levels.
    """
    levels = [picture]
    while min(levels[-1].shape[:2]) > 2:
        levels.append(np.asarray(Image.fromarray(levels[-1]).reduce(2)))
    ends = np.cumsum([level.size for level in levels])
    table = [
        (end - level.size, *level.shape[1::-1]) for end, level in zip(ends, levels, strict=True)
    ]
    return np.concatenate([level.ravel() for level in levels]), np.array(table)
