"""The ground of a film: one picture of a small world; of a large one fine tiles round the eye.

A tile is painted when the eye first comes near it and kept for a while. Which tiles are seen hangs
on the eye alone, so that every process that draws a part of a film sees the same ground. Under
the tiles lies the coarse picture of the whole, and round that plain land.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Single
from lrf3d.render.primitives import Draw, Mesh, Primitive, Span, Texture
from lrf3d.scene.ground import BRIGHTEST, Ground, paint_tile
from lrf3d.scene.look import GROUND_SHARPNESS
from lrf3d.scene.stage import Stage

_LAND_REACH = 3000.0
"""How far the ground goes [m]: to the horizon."""

_LARGE, _LARGE_INDOOR = 220.0, 60.0
"""Worlds longer than this [m] get fine tiles: one picture of the whole would be blurred."""

_TILE, _TILE_INDOOR = 80.0, 25.0
"""Side of a tile [m]."""

_NEAR = 0.5
"""Tiles nearer to the eye than this many of their sides are shown."""

_WIDEST = 160.0
"""Where more than this [m] is seen to each side, tiles show no more than the whole picture."""

_KEPT = 12
"""Tiles that are kept; each takes some five megabytes."""

_RAMP = 1.8
"""Width of the change between two paints in a picture [texels]: magnified, it is one pixel long
away from the eye, and some pixels wide across the view."""

_RIM, _RIM_INDOOR = 1e-3, 12.0
"""Width of the change from a picture to the land around it [m]: a town ends in lawns, which
go on there; a floor may be cut off."""

_UNDER = 2.0
"""How far the picture of the whole goes on under the tiles [m]."""

_BELOW = -0.02
"""Height [m] of what lies under the tiles."""


class _Piece(Primitive):
    """A rectangle of the ground: first its part near the eye, then what lies around that."""

    def __init__(self, low: Float, high: Float) -> None:
        inner = np.column_stack([_square(low, high), np.ones(6)])
        around = _ring(low, high, low, high)
        # Of each triangle of the ring, these corners are the inner ones.
        inwards = np.tile([0, 0, 1, 0, 1, 1], 4)
        self.low, self.high = low, high
        self.hollow = False
        super().__init__("ground", (3,), np.vstack([inner, np.column_stack([around, inwards])]))

    def near(self, eye: Float, reach: float) -> tuple[float, ...]:
        """Least and largest x and y of the part of it within so much [m] of an eye."""
        return self.within(eye[:2] - reach, eye[:2] + reach)

    def within(self, low: Float, high: Float) -> tuple[float, ...]:
        """Least and largest x and y of the part of it within a box [m]."""
        ends = [np.clip(end, self.low, self.high) for end in (low, high)]
        return tuple(np.concatenate(ends).tolist())

    @property
    def spans(self) -> tuple[Span, ...]:
        """The near part, which needs no smaller copies of its picture, and the rest."""
        around = "ground", 6, self.count - 6
        return (around,) if self.hollow else (("ground:NEAR", 0, 6), around)


@dataclass(frozen=True, slots=True)
class _Tile:
    """A painted tile, ready to be drawn."""

    primitive: _Piece
    area: tuple[float, ...]
    texel: float


class GroundLayer:
    """Draws the ground.

    Args:
        stage: What stands in the world, and its ground.
        scene: pyrender's scene, which new tiles are put into.

    Attributes:
        constants: What all pictures of it have in common: how bright ``BARE`` ground is; what
            marks, kerbs, pavements and lawns add to that, ``PAINTS``; and the colour of the
            ground ``BEYOND``, with the width of the change to it [m].
    """

    def __init__(self, stage: Stage, scene: Any) -> None:
        structures, walls, whole = stage
        self._structures, self._light = structures, walls.light
        self._scene = scene
        mark, bare, kerb, pavement, lawn = (BRIGHTEST * whole.brightness).tolist()
        paints = (mark - bare, kerb - bare, pavement - kerb, lawn - pavement)
        self._low, self._high = whole.corner, whole.corner + whole.size
        indoor = structures.indoor
        self._side = _TILE_INDOOR if indoor else _TILE
        self._large = float(whole.size.max()) > (_LARGE_INDOOR if indoor else _LARGE)
        self._tiles: dict[tuple[int, int], tuple[_Tile, Any]] = {}
        self._whole = _Piece(self._low, self._high)
        middle = 0.5 * (self._low + self._high)
        size = max(_LAND_REACH, float(whole.size.max()))
        land = _ring(middle - size, middle + size, self._low, self._high)
        self._land = Primitive("beyond", (2,), land)
        self._whole.texture = self._land.texture = Texture(whole.picture, far=True)
        self._all = _Tile(self._whole, _area(whole), _texel(whole))
        beyond = (*whole.beyond, _RIM_INDOOR if indoor else _RIM)
        self.constants = {"BARE": bare, "PAINTS": paints, "BEYOND": beyond}
        scene.add(Mesh([self._whole, self._land]))

    def draws(self, eye: Float, reach: float, focus: float) -> Iterator[Draw]:
        """What is drawn for an eye (3,) that looks down at so much to each side [m], or ahead.

        The focus is the number of pixels that a metre takes at a distance of one metre.
        """
        tiles = self._tiles_round(eye, reach)
        for tile in tiles:
            yield Draw(tile.primitive, self._uniforms(tile, eye, focus, 0.0))
        whole = self._uniforms(self._all, eye, focus, _BELOW if tiles else 0.0)
        # With several samples a pixel, what tiles hide would be painted before that is found out.
        self._whole.hollow = bool(tiles)
        if tiles:
            low = np.min([tile.primitive.low for tile in tiles], axis=0)
            high = np.max([tile.primitive.high for tile in tiles], axis=0)
            whole["near"] = self._whole.within(low + _UNDER, high - _UNDER)
        yield Draw(self._whole, whole)
        yield Draw(self._land, whole)

    def _uniforms(self, tile: "_Tile", eye: Float, focus: float, below: float) -> dict[str, Any]:
        """The uniforms of a tile, or of the whole, at a height [m]."""
        # On the ground a pixel is as long as the square of its distance, over this, says.
        long = focus * abs(float(eye[2]))
        edge = _RAMP * tile.texel * long
        # So far pixels are no longer than what the smaller copies of a picture are made for.
        far = tile.texel * long * 2.0 ** (GROUND_SHARPNESS + 0.5) - float(eye[2]) ** 2
        near = tile.primitive.near(eye, float(np.sqrt(0.5 * max(far, 0.0))))
        return {"area": tile.area, "below": below, "edge": edge, "near": near}

    def _tiles_round(self, eye: Float, reach: float) -> list[_Tile]:
        """The tiles round an eye; none where they would show no more than the whole picture."""
        if not self._large or reach > _WIDEST:
            return []
        reach = max(reach, _NEAR * self._side)
        first = np.floor((np.maximum(eye[:2] - reach, self._low)) / self._side).astype(int)
        last = np.floor((np.minimum(eye[:2] + reach, self._high)) / self._side).astype(int)
        tiles = [
            self._tile(column, row)
            for column in range(first[0], last[0] + 1)
            for row in range(first[1], last[1] + 1)
        ]
        self._forget(max(_KEPT, len(tiles)))
        return tiles

    def _tile(self, column: int, row: int) -> _Tile:
        place = column, row
        if place in self._tiles:
            # Those asked for last stand last.
            self._tiles[place] = self._tiles.pop(place)
            return self._tiles[place][0]
        low = self._side * np.array([column, row], dtype=np.float64)
        ground = paint_tile(self._structures, self._light, low, self._side)
        primitive = _Piece(low, low + self._side)
        primitive.texture = Texture(ground.picture, far=True)
        tile = _Tile(primitive, _area(ground), _texel(ground))
        self._tiles[place] = tile, self._scene.add(Mesh([primitive]))
        return tile

    def _forget(self, kept: int) -> None:
        """Let go of the tiles that were asked for longest ago, but for the newest ones."""
        while len(self._tiles) > kept:
            oldest, node = self._tiles.pop(next(iter(self._tiles)))
            self._scene.remove_node(node)
            assert oldest.primitive.texture is not None
            oldest.primitive.texture.delete()


def _texel(ground: Ground) -> float:
    """The size of a texel of a picture [m]."""
    return float(ground.size[0]) / int(ground.picture.shape[1])


def _area(ground: Ground) -> tuple[float, ...]:
    """Corner of a picture [m] and one over its size [1/m]."""
    return (*ground.corner.tolist(), *(1.0 / ground.size).tolist())


def _square(low: Float, high: Float) -> Single:
    """Corners (6, 2) of two triangles."""
    (x, y), (u, v) = low, high
    return np.array([[x, y], [u, y], [u, v], [x, y], [u, v], [x, v]], np.float32)


def _ring(low: Float, high: Float, inner_low: Float, inner_high: Float) -> Single:
    """Corners (24, 2) of the triangles between two boxes, which share corners and leave no seam."""
    outer = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    inner = np.array(
        [inner_low, [inner_high[0], inner_low[1]], inner_high, [inner_low[0], inner_high[1]]]
    )
    rows = []
    for side in range(4):
        following = (side + 1) % 4
        a, b, c, d = outer[side], outer[following], inner[following], inner[side]
        rows += [a, b, c, a, c, d]
    return np.array(rows, np.float32)
