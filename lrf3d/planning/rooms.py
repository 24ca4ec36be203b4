"""Rooms: the separate parts of the ground, and how much of the walls around them a drive shows.

What counts is what faces the drive's side of the walls: not the outside of a house that it goes
through, nor what lies within walls, but rooms that it does not reach.
"""

import numpy as np

from lrf3d.geometry import Bool, Float, Int, directions
from lrf3d.planning.free_space import MARGIN, THINNEST, Ground, connected
from lrf3d.world import World

LEAST_ROOM, LEAST_WIDTH = 4.0, 1.8
"""Least area [m²] and width [m] of a closed part that is a room; less is a shaft or furniture."""

ENTRANCE = 1.4
"""Width [m] of an opening to the outside above which what lies behind is a niche, and no room."""


def separate_rooms(ground: Ground, inside: Bool, reached: Bool) -> tuple[Int, Int]:
    """The connected parts of some cells (columns, rows), from 1, and the unreached rooms of these.

    What is closed in by walls of less than half the usual height is furniture.
    """
    from scipy.ndimage import binary_dilation, maximum

    # Neighbouring places that are farther than this from walls have none between them.
    least = max(THINNEST + MARGIN, 1.25 * ground.size)
    parts, count = connected(inside & (ground.gaps >= least))
    number, heights = np.arange(count + 1), ground.world.heights
    areas = np.bincount(parts.ravel(), minlength=count + 1) * ground.size**2
    rooms = (areas >= LEAST_ROOM) & ~np.isin(number, parts[reached]) & (number > 0)
    rooms &= maximum(ground.gaps, parts, number) >= 0.5 * LEAST_WIDTH
    entrance = binary_dilation(ground.swept, np.ones((3, 3), dtype=np.bool_))
    rooms &= maximum(np.where(entrance, ground.gaps, 0.0), parts, number) < 0.5 * ENTRANCE
    highest = maximum(heights[ground.walls[ground.nearest]], parts, number)
    return parts, np.flatnonzero(rooms & (highest >= 0.5 * np.median(heights)))


def shown_share(world: World, positions: Float, shown: Float, walls: Int) -> float | None:
    """The share of the walls on the drive's side of which the shown parts (k, 4) consist.

    The drive is at positions (m, 2) [m], the parts are of walls (k,). It is None if no wall faces
    the drive.
    """
    if not len(world.segments):
        return None
    ground = Ground(world, positions[0])
    reached = ground.cells_at(positions)
    outside = bool(ground.swept[reached].mean() > 0.5)
    side: Bool = ground.gaps > 0.0
    if world.free is None:
        side = ground.on_side("outside" if outside else "inside", None)
    parts, rooms = separate_rooms(ground, side, reached)
    if not outside:
        side = np.isin(parts, [*rooms, *np.unique(parts[reached])]) & (parts > 0)
    along = np.unique(ground.nearest[side])
    ends = np.full((len(world.segments), 2), np.nan)
    base, unit = world.segments[:, :2] - world.origin, directions(world.segments)
    for column in (0, 1):
        corner = shown[:, 2 * column : 2 * column + 2] - world.origin - base[walls]
        ends[walls, column] = (corner * unit[walls]).sum(axis=1)
    wall = ground.walls[along]
    station = ((ground.pieces[along] - base[wall]) * unit[wall]).sum(axis=1)
    seen = (station > ends[wall, 0] - 1e-3) & (station < ends[wall, 1] + 1e-3)
    return float(seen.mean()) if len(along) else None
