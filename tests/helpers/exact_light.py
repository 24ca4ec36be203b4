"""Beams behind mirrors and glass as rational numbers: the definition that casters are measured by.

A beam is mirrored into d − 2 (d · n) / (n · n) n, with the normal n = (−e_y, e_x) of the wall, and
goes on. All of it is rational: the wall that each leg ends on, and the sum of its lengths in units
of d, are exact.

Where walls touch, a beam may be mirrored or let through at a point that other walls hold. It meets
such a wall there only if it would cross to the wall's other side; one that it would go along it
meets once. So a beam into a corner of two mirrors is turned by both, and one onto a mirror on a
wall by the first of the two.

Shares and intensities are computed in float64; they decide only which beams go on.
"""

import math
from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

from rational import integers, meet

from lrf3d.casting.kernels import echoes
from lrf3d.casting.kernels.echoes import LEAST_SHARE, MOST_WALLS, SURFACE
from lrf3d.casting.kernels.light import MOST_TURNS
from lrf3d.geometry.lines import Float
from lrf3d.world.materials import PLAIN, Material

Vector = tuple[int, int]

KERNELS: tuple[Any, ...] = (echoes.shares, echoes.brightness, echoes.intensity)
# They are Python functions where nothing is compiled.
shares, brightness, intensity = (getattr(kernel, "py_func", kernel) for kernel in KERNELS)


def surface_of(material: Material) -> SimpleNamespace:
    """A material as the kernels take it."""
    values = (*material.optics, material.mirrors)
    return SimpleNamespace(**dict(zip(SURFACE.names or (), values, strict=True)))


class Echo(NamedTuple):
    """Light that returns: the way in lengths of the direction, its intensity, and the walls."""

    way: Fraction
    intensity: float
    chain: tuple[int, ...]


class _Ray(NamedTuple):
    """A ray: its origin place / scale, in units of the grid, and its direction turn / length.

    It arrived at its place along another direction; here counts the walls that it passed there.
    """

    place: Vector
    scale: int
    turn: Vector
    length: int
    way: Fraction = Fraction(0)
    gain: float = 1.0
    turns: int = 0
    chain: tuple[int, ...] = ()
    arrived: Vector = (0, 0)
    here: Mapping[int, int] = MappingProxyType({})


class ExactLight:
    """Walls (n, 4) with materials, None for plaster, among which beams are followed in integers."""

    def __init__(self, segments: Float, materials: list[Material | None]) -> None:
        self._segments = segments
        self._materials = [PLAIN if one is None else one for one in materials]

    def echoes(
        self,
        origin: tuple[float, float],
        direction: tuple[float, float],
        *,
        range_max: float,
        near_field: float = 0.0,
    ) -> list[Echo]:
        """The echoes of a beam up to a range [m], the strongest first."""
        flat = [float(value) for value in self._segments.ravel()]
        whole, self._unit = integers([*flat, *map(float, origin)])
        self._walls = [tuple(whole[k : k + 4]) for k in range(0, len(flat), 4)]
        turn, length = integers(direction)
        limit = Fraction(range_max) if math.isfinite(range_max) else None
        start = (whole[-2], whole[-1])
        waiting = [_Ray(start, 1, (turn[0], turn[1]), length, arrived=(turn[0], turn[1]))]
        found: list[Echo] = []
        while waiting:
            ray = waiting.pop()
            met = self._next(ray)
            if met is None:
                continue
            wall, t = met
            there = self._arrive(ray, wall, t)
            if limit is not None and there.way > limit:
                continue
            cos, sin = self._incidence(ray, wall)
            material = self._materials[wall]
            mirrored, passed = shares(cos, surface_of(material))
            bright = brightness(cos, sin, surface_of(material), mirrored)
            back = intensity(ray.gain * bright, float(there.way), near_field)
            if back > 0.0:
                found.append(Echo(there.way, back, there.chain))
            if len(there.chain) == MOST_WALLS:
                continue
            left = ray.gain * mirrored * mirrored
            if material.mirrors and left >= LEAST_SHARE and ray.turns < MOST_TURNS:
                waiting.append(self._mirrored(there, wall, left))
            left = ray.gain * passed * passed
            if left >= LEAST_SHARE:
                passed_through = {**there.here, wall: there.here[wall] + 1}
                waiting.append(there._replace(gain=left, here=passed_through))
        return sorted(found, key=lambda echo: -echo.intensity)

    def _next(self, ray: _Ray) -> tuple[int, tuple[int, int]] | None:
        """The wall that a ray meets next, and how far away as a fraction of its turn."""
        (x, y), s, (u, v) = ray.place, ray.scale, ray.turn
        best: tuple[int, tuple[int, int]] | None = None
        for wall, (x1, y1, x2, y2) in enumerate(self._walls):
            ax, ay, bx, by = x1 * s - x, y1 * s - y, x2 * s - x, y2 * s - y
            holds = ax * by == ay * bx and ax * bx + ay * by <= 0
            if holds and ray.chain and not self._meets_here(ray, wall):
                continue
            t = meet(ax, ay, bx, by, u, v)
            if t is None:
                continue
            if best is None or t[0] * best[1][1] < best[1][0] * t[1]:
                best = wall, t
        return best

    def _meets_here(self, ray: _Ray, wall: int) -> bool:
        """Whether a ray meets a wall that holds the point from which it goes on."""
        ex, ey = self._along(wall)
        (u, v), (old_u, old_v) = ray.turn, ray.arrived
        out = u * ey - v * ex
        if out == 0:
            return wall not in ray.here
        came = (old_u * ey - old_v * ex) * (-1) ** ray.here.get(wall, 0)
        return bool(came * out > 0)

    def _along(self, wall: int) -> Vector:
        x1, y1, x2, y2 = self._walls[wall]
        return x2 - x1, y2 - y1

    def _arrive(self, ray: _Ray, wall: int, t: tuple[int, int]) -> _Ray:
        """The ray from a wall that it meets, straight on."""
        above, below = t
        (x, y), (u, v) = ray.place, ray.turn
        x, y, scale = x * below + above * u, y * below + above * v, ray.scale * below
        common = math.gcd(x, y, scale)
        step = Fraction(above * ray.length, below * self._unit * ray.scale)
        still = above == 0 and bool(ray.chain)
        return ray._replace(
            place=(x // common, y // common),
            scale=scale // common,
            way=ray.way + step,
            chain=(*ray.chain, wall),
            arrived=ray.arrived if still else ray.turn,
            here={wall: 0, **ray.here} if still else {wall: 0},
        )

    def _mirrored(self, ray: _Ray, wall: int, gain: float) -> _Ray:
        """The ray, mirrored by the wall that it is at."""
        ex, ey = self._along(wall)
        u, v = ray.turn
        square, slope = ex * ex + ey * ey, u * ey - v * ex
        u, v, length = u * square - 2 * slope * ey, v * square + 2 * slope * ex, ray.length * square
        common = math.gcd(u, v, length)
        turn = u // common, v // common
        return ray._replace(turn=turn, length=length // common, gain=gain, turns=ray.turns + 1)

    def _incidence(self, ray: _Ray, wall: int) -> tuple[float, float]:
        """Cosine and sine of the angle of incidence."""
        ex, ey = self._along(wall)
        u, v = ray.turn
        size = (u * u + v * v) * (ex * ex + ey * ey)
        across, along = u * ey - v * ex, u * ex + v * ey
        return math.sqrt(Fraction(across**2, size)), math.sqrt(Fraction(along**2, size))
