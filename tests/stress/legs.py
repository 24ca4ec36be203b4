"""Ways of beams through mirrors and glass, with a bound on every rounding error.

Walls, a laser and its beams come in; what leaves are all ways on which light may return, and which
beams the bounds leave open. The arithmetic is that of long doubles, of 64 bits where the
machine has them, on all beams at once: it shares no code with lrf3d, and tests every wall on every
leg.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Bool, Float, Int

Long = NDArray[np.longdouble]

UNIT = np.longdouble(np.finfo(np.longdouble).eps)
"""Rounding of a long double, in parts of it."""

WALLS, TURNS = 16, 8
"""Walls on a way, and turns at most."""

LEAST, NEARLY = 0.01, 1e-6
"""Share of the light with which a beam goes on, and how far off, in parts, float64 may put it."""

INDEX, SCATTERED, SILVER = 1.52, 0.01, 0.95
"""The built-in glass: index and diffuse share; and the specular share of the built-in mirror."""


class Ways(NamedTuple):
    """All ways of some beams on which light may return.

    Attributes:
        beams: (m,) whose way it is.
        chains: (m, WALLS) the walls on it, then −1.
        ways: (m,) how long it is [m].
        errors: (m,) bound on the error of that [m].
        sure: (m,) whether enough light is left beyond doubt.
        open: (b,) beams about which the bounds leave a doubt.
    """

    beams: Int
    chains: Int
    ways: Long
    errors: Long
    sure: Bool
    open: Bool


def follow(
    segments: Float, kinds: list[str], origin: Float, directions: Float, limit: float
) -> Ways:
    """Follow beams from an origin (2,) in directions (b, 2) up to a limit [m].

    The kinds are built-in materials: ``mirror``, ``glass``, or any that lets nothing through.
    """
    ends = (segments.astype(np.longdouble).reshape(-1, 2, 2) - origin).reshape(-1, 4)
    shiny = np.isin(kinds, ["mirror", "glass"])
    clear = np.isin(kinds, ["glass"])
    count = len(directions)
    rays: dict[str, Any] = {
        "beam": np.arange(count),
        "place": np.zeros((count, 2), np.longdouble),
        "turn": directions.astype(np.longdouble),
        "way": np.zeros(count, np.longdouble),
        "place_error": np.zeros(count, np.longdouble),
        "turn_error": np.zeros(count, np.longdouble),
        "way_error": np.zeros(count, np.longdouble),
        "gain": np.ones(count),
        "turns": np.zeros(count, np.int64),
        "chain": np.full((count, WALLS), -1),
    }
    doubtful = np.zeros(count, np.bool_)
    found: list[dict[str, Any]] = []
    for length in range(WALLS):
        wall, t, t_error, unsure = _next(ends, rays, length)
        way, error = rays["way"] + t, rays["way_error"] + t_error + UNIT * (rays["way"] + t)
        near_limit = (wall >= 0) & (abs(way - limit) <= error + UNIT * limit)
        doubtful[rays["beam"][unsure | near_limit]] = True
        kept = (wall >= 0) & ~unsure & (way < limit)
        rays = {name: values[kept] for name, values in rays.items()}
        wall, t, t_error = wall[kept], t[kept, None], t_error[kept]
        rays["way"], rays["way_error"] = way[kept], error[kept]
        rays["place_error"] = rays["place_error"] + t_error + t[:, 0] * rays["turn_error"]
        rays["place"] = rays["place"] + t * rays["turn"]
        rays["place_error"] += 4 * UNIT * (abs(rays["place"]).sum(axis=1) + t[:, 0])
        rays["chain"][:, length] = wall
        along = ends[wall, 2:] - ends[wall, :2]
        mirrored, passed = shares(along, rays["turn"], clear[wall])
        ending = clear[wall] | ~shiny[wall]
        found.append({name: values[ending] for name, values in rays.items()})
        back = rays["gain"] * mirrored**2
        on = shiny[wall] & (rays["turns"] < TURNS) & (back >= LEAST * (1.0 - NEARLY))
        turned = {name: values[on].copy() for name, values in rays.items()}
        turned["turn"] = _turned(along[on], turned["turn"])
        # A reflection keeps the length of an error; its own rounding takes 22 units.
        turned["turn_error"] = turned["turn_error"] + 24 * UNIT
        turned["gain"], turned["turns"] = back[on], turned["turns"] + 1
        through = rays["gain"] * passed**2
        on = clear[wall] & (through >= LEAST * (1.0 - NEARLY))
        straight = {name: values[on].copy() for name, values in rays.items()}
        straight["gain"] = through[on]
        rays = {name: np.concatenate([turned[name], straight[name]]) for name in rays}
        if not len(wall):
            break
    every = {name: np.concatenate([some[name] for some in found]) for name in rays}
    return Ways(
        every["beam"],
        every["chain"],
        every["way"],
        every["way_error"],
        every["gain"] >= LEAST * (1.0 + NEARLY),
        doubtful,
    )


def _next(ends: Long, rays: dict[str, Any], length: int) -> tuple[Int, Long, Long, Bool]:
    """The walls (r,) that rays meet next, how far away, how far off that is, and whether unsure."""
    rows = len(rays["beam"])
    if rows == 0:
        none = np.zeros(0, np.longdouble)
        return np.zeros(0, np.int64), none, none, np.zeros(0, np.bool_)
    dx, dy = rays["turn"][:, :1], rays["turn"][:, 1:]
    x, y = rays["place"][:, :1], rays["place"][:, 1:]
    ax, ay, bx, by = ends[:, 0] - x, ends[:, 1] - y, ends[:, 2] - x, ends[:, 3] - y
    ex, ey = ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1]
    side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
    most = abs(ends).max() + abs(rays["place"]).max(axis=1, keepdims=True)
    place_error, turn_error = rays["place_error"][:, None], rays["turn_error"][:, None]
    bound = 16 * UNIT * most + 2 * place_error + 4 * most * turn_error
    low, high = np.minimum(side_a, side_b), np.maximum(side_a, side_b)
    apart = (low > bound) | (high < -bound)
    slope = dx * ey - dy * ex
    crossing = (low < -bound) & (high > bound) & (abs(slope) > 4 * bound)
    if length:
        own = np.arange(len(ends)) == rays["chain"][:, length - 1 : length]
        apart, crossing = apart | own, crossing & ~own
    one, other = dx * ax + dy * ay, dx * bx + dy * by
    ahead = np.maximum(one, other) >= -bound
    possible = np.maximum(np.minimum(one, other) - bound, 0)
    doubt = np.where(~apart & ~crossing & ahead, possible, np.inf).min(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (ax * ey - ay * ex) / slope
        # Each product and difference rounds, and so did the ends; the rest comes with the ray.
        extent = abs(ex) + abs(ey)
        area_error = 4 * UNIT * (abs(ax * ey) + abs(ay * ex)) + place_error * extent
        area_error += UNIT * abs(ends).max() * extent
        slope_error = 4 * UNIT * (abs(dx * ey) + abs(dy * ex)) + turn_error * extent
        error = 1.01 * (area_error + abs(t) * slope_error) / abs(slope) + UNIT * abs(t)
    t, error = np.where(crossing, t, 0), np.where(crossing, error, 0)
    met = crossing & (t + error >= 0)
    doubt = np.where((met & (t - error <= 0)).any(axis=1), 0, doubt)
    t, error = np.where(met, t, np.inf), np.where(met, error, 0)
    wall = t.argmin(axis=1)
    row = np.arange(rows)
    best, best_error = t[row, wall], error[row, wall]
    lows = t - error
    lows[row, wall] = np.inf
    unsure = np.isfinite(best) & (np.minimum(lows.min(axis=1), doubt) <= best + best_error)
    unsure |= ~np.isfinite(best) & np.isfinite(doubt)
    wall = np.where(np.isfinite(best), wall, -1)
    return wall, np.where(wall >= 0, best, 0), best_error, unsure


def _turned(along: Long, turn: Long) -> Long:
    """Directions (r, 2), mirrored by walls that run along (r, 2)."""
    slope = turn[:, 0] * along[:, 1] - turn[:, 1] * along[:, 0]
    twice = 2 * slope / (along**2).sum(axis=1)
    turned: Long = turn + twice[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
    return turned


def shares(along: Long, turn: Long, clear: Bool) -> tuple[Float, Float]:
    """Shares of light that walls mirror and let pass: Fresnel's of a pane, or those of a mirror."""
    cos = abs(turn[:, 0] * along[:, 1] - turn[:, 1] * along[:, 0]).astype(np.float64)
    cos /= np.hypot(*along.T.astype(np.float64)) * np.hypot(*turn.T.astype(np.float64))
    angle = np.arccos(np.clip(cos, 0.0, 1.0))
    inside = np.arcsin(np.sin(angle) / INDEX)
    across = ((cos - INDEX * np.cos(inside)) / (cos + INDEX * np.cos(inside))) ** 2
    flat = ((np.cos(inside) - INDEX * cos) / (np.cos(inside) + INDEX * cos)) ** 2
    pane = 0.5 * (2.0 * across / (1.0 + across) + 2.0 * flat / (1.0 + flat))
    mirrored = np.where(clear, (1.0 - SCATTERED) * pane, SILVER)
    return mirrored, np.where(clear, (1.0 - SCATTERED) * (1.0 - pane), 0.0)
