"""Hidden panes: panes that returned no light themselves, known by what they mirror.

A pane stands between the ends of two walls. Dark returns behind such a gap are images in a pane if
they all lie as far behind it as one wall of the map lies before it, and if their light changes from
view to view as Fresnel's equations say for that pane, which the light of a diffuse wall would not.
Returns, segments and walls go in; which returns are such images comes out.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, cross, directions, lengths
from lrf3d.mapping.robust.optics_constants import (
    FLASH_SHARE,
    FRAME_DISTANCE,
    IMAGE_DISTANCE,
    LEAST_COSINE,
    PANE_DEPTH,
    PANE_GAP,
    SHORTEST_PANE,
)
from lrf3d.mapping.robust.pane_images import COSINES, MIRRORED, MOST_BLUR, beside
from lrf3d.mapping.robust.pane_stretches import frames

DARK_SHARE = 0.5
"""[share] Returns darker than this part of what is usual, at their incidence, may be images."""

LEAST_DARK = 3
"""[returns] Fewer in a line cannot show how their light changes."""

END_ERROR = 0.1
"""[m] Error of the end of a wall in the map, and so of the end of a pane."""

EXTENSION = 1.0
"""[m] How far a wall may go on beyond what the map shows of it."""

LIGHT_FACTOR = 2.0
"""[factor] How much brighter or darker an image may be than Fresnel's equations say: the direction
of a short pane is known to a few degrees only."""

LIGHT_CHANGE = np.log(1.25)
"""[logarithm] Light that changes less than this from view to view may be that of a diffuse wall."""

LIGHT_GAIN = 3.0
"""[factor] How many times more the light must vary for a diffuse wall than for the image."""


class View(NamedTuple):
    """Returns in one line, and from where they were seen.

    Args:
        places: (k, 2) where they are [m].
        lasers: (k, 2) where the laser was [m].
        units: (k, 2) the directions of their beams.
        sizes: (k,) their ranges [m].
        bright: (k,) their brightness, as a share of the usual one.
        deviations: (k,) standard deviations of their ranges [m].
        change: By how much the logarithm of the reflectance changes that a wall there would have.
    """

    places: Float
    lasers: Float
    units: Float
    sizes: Float
    bright: Float
    deviations: Float
    change: float


def hidden_images(returns: Float, known: Bool, segments: Float, walls: Float, usual: float) -> Bool:
    """Which returns (c,) are images, those in hidden panes among them.

    Args:
        returns: (c, 6) returns as `PaneImages` keeps them.
        known: (c,) which of them are known to be images.
        segments: (s, 4) what the map shows [m].
        walls: (w, 4) the walls of which there may be images [m].
        usual: The usual brightness of a return.
    """
    found = known.copy()
    for rows, unit, ends in _dark_runs(returns, segments, usual):
        places, lasers, bright = returns[rows, :2], returns[rows, 2:4], returns[rows, 4] / usual
        rays = np.hstack([lasers, places])
        units = directions(rays)
        change = float(np.ptp(np.log(bright / np.abs(cross(units, unit)))))
        if change > LIGHT_CHANGE and not found[rows].all():
            view = View(places, lasers, units, lengths(rays), bright, returns[rows, 5], change)
            corners = np.concatenate([segments.reshape(-1, 2), ends])
            found[rows] |= _mirrored(view, corners, walls)
    return found


def _dark_runs(returns: Float, segments: Float, usual: float) -> Iterator[tuple[Int, Float, Float]]:
    """Runs of dark returns at an end of one of segments (s, 4), up to where it is brighter.

    Returns:
        Of each run the rows of its returns, the direction (2,) of the segment, and where it becomes
        brighter (e, 2) [m]: a wall may end there.
    """
    places, along = returns[:, :2], directions(segments)
    units, bright = directions(returns[:, [2, 3, 0, 1]]), returns[:, 4] / usual
    dim = np.flatnonzero(bright < DARK_SHARE)
    of, row = beside(places[dim], segments)
    dark = bright[dim[of]] < DARK_SHARE * np.abs(cross(units[dim[of]], along[row]))
    tried = np.flatnonzero(np.bincount(row[dark], minlength=len(segments)) >= LEAST_DARK)
    of, row = beside(places, segments[tried])
    for place, k in enumerate(tried.tolist()):
        rows = of[row == place]
        # What beams meet along the segment is something else, beside it or across.
        rows = rows[np.abs(cross(units[rows], along[k])) > LEAST_COSINE]
        if (bright[rows] > FLASH_SHARE).any():
            continue
        stations = (places[rows] - segments[k, :2]) @ along[k]
        order = np.argsort(stations, kind="stable")
        rows, stations = rows[order], stations[order]
        lit = bright[rows] >= DARK_SHARE * np.abs(cross(units[rows], along[k]))
        edges = np.flatnonzero(np.diff(lit))
        runs = np.split(np.arange(len(rows)), edges + 1)
        outer = edges[[0, -1]] if len(edges) else edges
        middles = 0.5 * (stations[outer] + stations[outer + 1])
        ends = segments[k, :2] + middles[:, None] * along[k]
        for run in runs[:1] + runs[1:][-1:]:
            if len(run) >= LEAST_DARK and not lit[run[0]]:
                yield rows[run], along[k], ends


def _mirrored(view: View, corners: Float, walls: Float) -> bool:
    """Whether a pane between two of corners (e, 2) [m] shows a view as the image of a wall."""
    first, last = _gaps(view, corners)
    along = directions(np.hstack([first, last]))
    normals = along @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    before = np.einsum("gki,gi->gk", view.lasers - first[:, None], normals)
    behind = np.einsum("gki,gi->gk", view.places - first[:, None], normals)
    cosine = np.abs(behind - before) / view.sizes
    mirrored = np.interp(cosine, COSINES, MIRRORED) ** 2
    able = (before * behind < 0.0) & (np.abs(behind) > PANE_DEPTH * cosine)
    able &= view.bright < LIGHT_FACTOR * mirrored
    rows = np.flatnonzero(able.all(axis=1))
    first, last, normals = first[rows], last[rows], normals[rows]
    behind, mirrored = behind[rows], mirrored[rows]
    images = view.places - 2.0 * behind[..., None] * normals[:, None]
    # The farther off the pane, the farther off is the image of a pane that is a little askew.
    away = np.hypot(*(view.places - 0.5 * (first + last)[:, None]).transpose(2, 0, 1))
    askew = END_ERROR / np.hypot(*(last - first).T)
    allowed = np.minimum(2.0 * away * askew[:, None] + END_ERROR, MOST_BLUR)
    allowed += IMAGE_DISTANCE + view.deviations
    # Few walls lie by both of the outermost images: only these are looked at closely.
    outer = [0, -1]
    for gap, wall in np.argwhere(_by(images[:, outer], allowed[:, outer], walls).all(axis=1)):
        own, normal = walls[wall, None], normals[gap]
        if not _by(images[gap, None], allowed[gap, None], own).all():
            continue
        turned = view.units - 2.0 * (view.units @ normal)[:, None] * normal
        expected = mirrored[gap] * np.abs(cross(turned, directions(own)))
        light = np.log(view.bright / expected)
        if LIGHT_GAIN * np.ptp(light) < view.change and abs(light.mean()) < np.log(LIGHT_FACTOR):
            size = float(np.hypot(*(last[gap] - first[gap])))
            across = frames(first[gap], (last[gap] - first[gap]) / size, walls)
            if not ((across > FRAME_DISTANCE) & (across < size - FRAME_DISTANCE)).any():
                return True
    return False


def _gaps(view: View, corners: Float) -> tuple[Float, Float]:
    """The gaps between two of corners (e, 2) [m] that all beams of a view go through.

    Returns:
        The corner (g, 2) to the left of the beams, and that to their right (g, 2) [m].
    """
    offset = corners[:, None] - view.lasers
    aside = cross(view.units, offset)
    way = np.einsum("eki,ki->ek", offset, view.units)
    near = ((way > -PANE_GAP) & (way < view.sizes + PANE_GAP)).all(axis=1)
    left = corners[near & ((aside > -END_ERROR) & (aside < PANE_GAP)).all(axis=1)]
    right = corners[near & ((aside < END_ERROR) & (aside > -PANE_GAP)).all(axis=1)]
    apart = np.hypot(*(left[:, None] - right).transpose(2, 0, 1))
    one, other = np.nonzero((apart > SHORTEST_PANE) & (apart < PANE_GAP))
    return left[one], right[other]


def _by(points: Float, allowed: Float, walls: Float) -> Bool:
    """Which points (g, k, 2) lie by walls (w, 4), or where these may go on: (g, k, w)."""
    along = directions(walls)
    x, y = points[..., 0, None] - walls[:, 0], points[..., 1, None] - walls[:, 1]
    stations = x * along[:, 0] + y * along[:, 1]
    by: Bool = np.abs(y * along[:, 0] - x * along[:, 1]) < allowed[..., None]
    return by & (stations > -EXTENSION) & (stations < lengths(walls) + EXTENSION)
