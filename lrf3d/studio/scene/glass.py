"""Glass: panes as they are seen from an eye, and what beams do at them, mirrors and reflectors.

Walls of glass, an eye and scans enter; translucent faces, lines and counts leave.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from lrf3d.base.text import counted
from lrf3d.geometry.lines import LEFT, Bool, Float, Int, directions, lengths
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import unrolled
from lrf3d.studio.scene import look
from lrf3d.studio.scene.marks import divided
from lrf3d.studio.scene.shapes import Lines, Soft, level_lines, single
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.exposure import Exposure
from lrf3d.studio.scene.stage.structures import Structures, folded, walls_of
from lrf3d.studio.scene.timeline import FIRST
from lrf3d.world import World

# Colour of a beam that goes through glass.
THROUGH_COLOUR = look.rgb("#7fe3ff")

# Colour of a beam that comes back from it, or from a mirror.
BACK_COLOUR = look.rgb("#fff2cc")

# Colour of a beam that comes back from a reflector.
REFLECTED_COLOUR = look.MATERIAL_COLOURS["retro"]

# Distance from a pane or a robot within which a beam ends there [m]: more than usual noise.
_AT_PANE = 0.1

# The same of a place without a wall from a beam that goes through [m].
_AT_PLACE = 0.2

# Width of the parts of a front of glass [m].
_BAY = 1.3

# Height of panes where walls are cut [m]: they stand out, and hide little.
_HIGH = 1.9

# Opacity that a pane gains as it is seen from its edge.
_FRESNEL = 0.45

# Opacity of the gleam in the upper corner of each part, which fades towards the others.
_GLEAM = 0.14

# Opacity that a pane gains as it comes into the map.
_KNOWN = 0.22

# Share of the opacity that panes have in the dark.
_UNLIT = 0.3

# Number of beams through glass that are drawn of a scan, about, and of those that come back from
# it: of more, some are chosen evenly.
_DRAWN = 6

# Opacity of these beams.
_BEAM = 0.8

# Width of these beams [pixels of 720 lines].
_WIDE = 2.2 * look.FINE

# Share of a run in which the scan is chosen that a film shows.
EARLY = 0.75

# Least number of beams that come back there, in that of those that meet glass.
_SOME = 0.1

# Number of scans that are counted, at most.
_COUNTED = 400


class Panes(NamedTuple):
    """The panes of glass of a world, in parts of about one width."""

    # (n, 4, 3) corners, the first two at the foot [m].
    corners: Float
    # (n, 2) normals.
    normals: Float
    # (n,) when the laser first met each [lengths of the run]; +inf for never.
    seen: Float
    # (n,) when it came into the map, likewise.
    mapped: Float
    # The posts between them, and the edges of mirrors.
    edges: Lines

    @classmethod
    def of(cls, structures: Structures, cut: float, exposure: Exposure | None = None) -> "Panes":
        """The panes up to the height of a cut [m]; where all is lit, no exposure is given."""
        clear = structures.glass
        walls = structures.segments[clear]
        count = np.maximum(np.round(lengths(walls) / _BAY), 1.0).astype(int)
        parts, owner = divided(walls, count)
        tops = np.minimum(structures.heights[clear], max(cut, _HIGH))[owner]
        framed = structures.mirrors
        segments = np.concatenate([parts, structures.segments[framed]])
        tops = np.append(tops, np.minimum(structures.heights[framed], cut))
        foot, far = (np.insert(ends, 2, 0.0, axis=1) for ends in np.hsplit(segments, 2))
        c, d = (ends + tops[:, None] * [0.0, 0.0, 1.0] for ends in (far, foot))
        starts = np.concatenate([foot, far, d])
        colours = single(np.full((len(starts), 3), look.MATERIAL_COLOURS["glass"]))
        full = np.ones((len(starts), 2), np.float32)
        edges = Lines(
            single(starts), single(np.concatenate([d, c, c])), colours, full, 1.5 * look.FINE
        )
        corners = np.stack([foot, far, c, d], axis=1)[: len(parts)]
        seen = np.full(len(parts), -np.inf)
        mapped = np.full(len(parts), np.inf)
        if exposure is not None:
            found = exposure.sampled(0.5 * (parts[:, :2] + parts[:, 2:]))
            seen = np.where(found["sure"] > 0.5, found["seen"], np.inf)
            mapped = found["mapped"]
        return cls(corners, directions(parts) @ LEFT, seen, mapped, edges)

    def faces(self, eye: Float, now: float) -> Soft:
        """The panes from an eye (3,) at a time [lengths of the run]: opaque only at grazing angles.

        The reflectance grows with the fifth power of 1 − cos θ (Schlick, 1994).
        """
        way = self.corners - eye
        flat = np.einsum("nki,ni->nk", way[..., :2], self.normals)
        cosine = np.abs(flat) / np.maximum(np.linalg.norm(way, axis=2), look.TINY)
        alpha = look.PANE + _FRESNEL * (1.0 - cosine) ** 5 + _GLEAM * np.array([0.0, 0.0, 0.3, 1.0])
        known = (self.mapped <= now)[:, None]
        alpha *= np.where(self.seen <= now, 1.0, _UNLIT)[:, None]
        alpha += _KNOWN * known
        tint = np.where(known[..., None], THROUGH_COLOUR, look.MATERIAL_COLOURS["glass"])
        tint = np.broadcast_to(tint, (*alpha.shape, 3))
        order = [0, 1, 2, 0, 2, 3]
        colours = np.dstack([tint, alpha])[:, order].reshape(-1, 3, 4)
        return Soft(single(self.corners[:, order].reshape(-1, 3, 3)), single(colours))


def at_glass(world: World, starts: Float, ends: Float) -> tuple[Bool, Bool]:
    """Which beams from (n, 2) to hits (n, 2) went through glass, and which came back from it."""
    panes = panes_of(world)
    back = shapely.dwithin(panes, shapely.points(ends), _AT_PANE)
    ways = shapely.linestrings(np.stack([starts, ends], axis=1))
    return shapely.intersects(panes, ways) & ~back, back


@lru_cache(1)
def panes_of(world: World) -> shapely.Geometry:
    """All walls of glass of a world."""
    walls = world.segments[walls_of(world, lambda material: material.passes)]
    panes = shapely.union_all(shapely.linestrings(walls.reshape(-1, 2, 2)))
    shapely.prepare(panes)
    return panes


def met_reflectors(run: Shown, number: int) -> Int:
    """The hits of a scan that came back from reflectors, one of each."""
    scan = run.scans_at(number)[0]
    walls = scan.walls[scan.hits]
    bright = walls_of(run.world, lambda material: material.retro > 1.0)
    met, first = np.unique(walls, return_index=True)
    return first[np.isin(met, np.flatnonzero(bright))]


def _met_robots(run: Shown, number: int, ends: Float) -> Bool:
    """Which hits (n, 2) of a scan lie on other robots."""
    now = run.trajectory.times[number : number + 1]
    met = np.zeros(len(ends), bool)
    for each in filter(lambda obstacle: obstacle.is_robot, run.obstacles):
        away = np.hypot(*(ends - each.path.at(now)[:, :2]).T)
        met |= away < each.reach + _AT_PANE
    return met


class TellingBeams(NamedTuple):
    """Beams of a scan that tell what a film is about."""

    # What they are.
    words: str
    # Where they end (n, 2) [m].
    ends: Float
    colour: look.Colour


@lru_cache(2)
def telling_beams(run: Shown, number: int) -> tuple[TellingBeams, ...]:
    """The beams of a scan at glass, and those that other robots or reflectors send back."""
    scan = unrolled(run.scans_at(number)[0])
    ends = scan.points()
    found = []
    if counts_at_glass(run).back:
        through, back = at_glass(run.world, np.broadcast_to(scan.pose[:2], ends.shape), ends)
        words = f"{counted(int(through.sum()), 'beam')} through glass"
        found.append(TellingBeams(words, ends[through], THROUGH_COLOUR))
        found.append(TellingBeams(f"{back.sum()} back from it", ends[back], BACK_COLOUR))
    met = _met_robots(run, number, ends)
    if met.any():
        words = f"{counted(int(met.sum()), 'beam')} that another robot stops"
        found.append(TellingBeams(words, ends[met], BACK_COLOUR))
    bright = met_reflectors(run, number)
    if len(bright) and not any(each.is_robot for each in run.obstacles):
        words = f"back from {counted(len(bright), 'reflector')}"
        found.append(TellingBeams(words, ends[bright], REFLECTED_COLOUR))
    return tuple(found)


def beams_through(run: Shown, number: int, places: Float) -> TellingBeams:
    """The beams of a scan that go through places (n, 2) without a wall."""
    scan = unrolled(run.scans_at(number)[0])
    ends = scan.points()
    ways = shapely.linestrings(np.stack([np.broadcast_to(scan.pose[:2], ends.shape), ends], axis=1))
    through = shapely.dwithin(ways, shapely.multipoints(places), _AT_PLACE)
    words = f"{counted(int(through.sum()), 'beam')} through it"
    return TellingBeams(words, ends[through], THROUGH_COLOUR)


def some_beams(apex: Float, beams: TellingBeams, origin: Float, height: float) -> Lines:
    """Some of the beams from an apex (2,), in the film's frame with an origin (2,) in the world."""
    ends = beams.ends[:: 1 + len(beams.ends) // _DRAWN] - origin
    colours = np.tile(beams.colour, (len(ends), 1))
    begins = np.broadcast_to(apex, ends.shape)
    return level_lines(height, begins, ends, colours, np.full(ends.shape, _BEAM), _WIDE)


def bounced(
    scan: LaserScan, mirrors: Float, apex: Float, aim: Float, height: float
) -> Lines | None:
    """The beam of which the laser takes the end to be nearest to an aim (2,) behind a mirror.

    The pose of the scan, the mirrors (m, 4) and the apex (2,), where the beam begins, are in the
    film's frame. None where no beam is turned.
    """
    ends = scan.points()
    legs, beams, _ = folded(np.array(scan.pose[:2]), ends, mirrors)
    turned = np.flatnonzero(np.bincount(beams) > 1)
    if not len(turned):
        return None
    best = turned[np.argmin(np.hypot(*(ends[turned] - aim).T))]
    legs = legs[beams == best]
    legs[0, :2] = apex
    way = np.vstack([legs, [*legs[0, 2:], *ends[best]]])
    colours = np.array([*[BACK_COLOUR] * len(legs), look.FALSE_COLOUR])
    starts, stops = np.hsplit(way, 2)
    return level_lines(height, starts, stops, colours, np.ones((len(way), 2)), look.BOLD)


class GlassCounts(NamedTuple):
    """What the beams of a run did at its glass."""

    # How many went through it.
    through: int = 0
    # How many came back from it.
    back: int = 0
    # The scan of which most beams met it, and some came back; the first scans do not count.
    scan: int = 0
    # The pane from which most of these came back (4,) [m].
    pane: Float = np.zeros(4)


@lru_cache(1)
def counts_at_glass(run: Shown) -> GlassCounts:
    """What the beams of a run did at its glass; of a long run some scans are counted for all."""
    if not walls_of(run.world, lambda material: material.passes).any():
        return GlassCounts()
    numbers = range(0, len(run.trajectory.times), 1 + len(run.trajectory.times) // _COUNTED)
    scans = [run.scans_at(number)[0] for number in numbers]
    points = [scan.points() for scan in scans]
    owner = np.repeat(numbers, [len(each) for each in points])
    ends = np.concatenate(points)
    starts = np.array([scan.pose[:2] for scan in scans])[owner // numbers.step]
    through, back = at_glass(run.world, starts, ends)
    # A film opens with the first scan, and ends on the whole.
    times = run.trajectory.times - run.trajectory.times.min()
    late = (times[owner] > FIRST * run.playback) & (times[owner] < EARLY * times.max())
    late |= not (late & back).any()
    returned, met = (
        np.bincount(owner[late & each], minlength=1) for each in (back, through | back)
    )
    most = int(np.argmax(np.where(returned >= _SOME * met.max(), met, 0)))
    walls = np.concatenate([scan.walls[scan.hits] for scan in scans])
    pane = int(np.argmax(np.bincount(walls[back & (owner == most)], minlength=1)))
    step = numbers.step
    return GlassCounts(
        step * int(through.sum()), step * int(back.sum()), most, run.world.segments[pane]
    )
