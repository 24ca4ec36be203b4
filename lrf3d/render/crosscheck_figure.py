"""Cross-check figure: the world with the beams that two casters see differently, and these close.

Close means at the scale of what decides: each small panel looks from above at the place where the
beam passes a wall, a few micrometres wide, with the width that float32 cannot resolve around it.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lrf3d.casting.causes import Cause
from lrf3d.casting.comparison import CrossCheck, Difference
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder
from lrf3d.render.chart import HEAD, Sheet
from lrf3d.render.marks import BEAM, draw_poses, draw_walls
from lrf3d.render.page import FAINT, INK, Frame
from lrf3d.world import World

MOST_CLOSE = 6
"""Beams shown close at most; the others stand in the overview."""

OVERVIEW = 6.6
"""Longer side of the overview [inches]."""

CLOSE, GAP, BELOW = 2.3, 0.75, 0.75
"""Side of a close panel, room beside and room below panels [inches]."""

VIEW = 2.0
"""Half the width of a close panel, in resolutions of float32."""

WRONG = "#7a3fb0"
"""Colour of Embree's answer."""


def draw_crosscheck(
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    result: CrossCheck,
    path: str | Path | None = None,
) -> Figure:
    """Draw a world, the poses (k, 3), and the beams that the casters see differently.

    Raises:
        OutputError: The picture cannot be written.
    """
    frame = Frame.around([world.segments.reshape(-1, 2), poses[:, :2]])
    width, height = OVERVIEW * frame.size / frame.size.max()
    chosen = most_telling(result.differences)
    rows = max(1, int((height + BELOW) / (CLOSE + BELOW))) if len(chosen) else 1
    rows = max(rows, -(-len(chosen) // 3))
    columns = -(-len(chosen) // rows)
    tall = max(height, rows * (CLOSE + BELOW) - BELOW if len(chosen) else 0.0)
    sheet = Sheet(
        GAP + width + columns * (GAP + CLOSE) + 0.3,
        HEAD + 0.25 + tall + BELOW + 0.35,
        _titles(world, result),
    )
    top = BELOW + 0.35 + tall
    axes = sheet.panel(GAP, top - height, width, height)
    signs = _overview(axes, frame, world, lrf, poses, result.differences, chosen)
    for number, one in enumerate(chosen):
        column, row = divmod(number, rows)
        left = GAP + width + GAP + column * (CLOSE + GAP)
        panel = sheet.panel(left, top - CLOSE - row * (CLOSE + BELOW), CLOSE, CLOSE)
        signs_close = _close(panel, number + 1, one, world, lrf, poses, result.resolution)
        signs += signs_close if number == 0 else []
    sheet.figure.legend(
        handles=signs, loc="lower center", ncols=len(signs), frameon=False, fontsize=9,
        labelcolor=INK, bbox_to_anchor=(0.5, 0.04 / sheet.size[1]), borderaxespad=0.0,
    )  # fmt: skip
    return sheet.save(path)


def most_telling(differences: tuple[Difference, ...]) -> list[Difference]:
    """A few of the differences: those of the rarest causes, and of each the largest."""
    by_cause: dict[Cause, list[Difference]] = {}
    for one in sorted(differences, key=_gap, reverse=True):
        by_cause.setdefault(one.cause, []).append(one)
    ranked = sorted(by_cause.values(), key=lambda kind: (kind[0].cause != "unexplained", len(kind)))
    chosen = [kind[turn] for turn in range(MOST_CLOSE) for kind in ranked if turn < len(kind)]
    return chosen[:MOST_CLOSE]


def _gap(one: Difference) -> float:
    gap = abs(one.planar[0] - one.embree[0])
    return gap if gap == gap else 0.0


def _titles(world: World, result: CrossCheck) -> tuple[str, str]:
    other = "bare Embree" if result.raw else "Embree"
    differ = len(result.differences)
    if differ == 0:
        exactly = "" if result.largest_difference else ", to the last bit"
        found = f"all agree on wall and range{exactly}"
    else:
        causes = ", ".join(f"{count} {cause}" for cause, count in result.causes.items())
        found = f"{differ} seen differently: {causes}"
    title = f"{world.name or 'world'}: the plane against {other}"
    return title, f"{result.beams:,} beams  ·  {found}"


def _overview(
    axes: Axes,
    frame: Frame,
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    differences: tuple[Difference, ...],
    chosen: list[Difference],
) -> list[Line2D]:
    axes.set(xlim=(frame.low[0], frame.high[0]), ylim=(frame.low[1], frame.high[1]))
    axes.set_aspect("equal")
    for name, origin in zip("xy", frame.origin, strict=True):
        label = f"{name} [m]" if not frame.origin.any() else f"{name} − {origin:.0f} [m]"
        axes.set(**{f"{name}label": label})
    axes.xaxis.label.set(color=FAINT, fontsize=9)
    axes.yaxis.label.set(color=FAINT, fontsize=9)
    signs = draw_walls(axes, frame, world, poses, INK, width=1.2)
    signs += draw_poses(axes, frame, poses)
    if not differences:
        return signs
    starts = frame.local(poses[[one.scan for one in differences], :2])
    beams = np.array([_beam(lrf, poses, one) for one in differences])
    # Many beams are drawn finer, or they would hide the world and each other.
    fine = float(np.interp(len(differences), [20, 100], [1.0, 0.4]))
    for answers, colour, label, width in (
        ([one.embree[0] for one in differences], WRONG, "Embree's answer", 1.2),
        ([one.planar[0] for one in differences], BEAM, "exact answer", 2.0),
    ):
        reach = np.clip(np.array(answers), 0.0, lrf.range_max)
        ends = starts + reach[:, None] * beams
        lines = LineCollection(
            list(np.stack([starts, ends], axis=1)), colors=colour, linewidths=fine * width, zorder=4
        )
        axes.add_collection(lines)
        axes.scatter(ends[:, 0], ends[:, 1], s=16 * fine, color=colour, linewidths=0, zorder=5)
        signs.append(Line2D([], [], color=colour, linewidth=width + 0.4, marker=".", label=label))
    for number, one in enumerate(chosen, start=1):
        x, y = frame.local(_decided(world, lrf, poses, one)[None])[0].tolist()
        axes.scatter(x, y, s=150, facecolor="white", edgecolor=INK, linewidths=1.0, zorder=8)
        digit = axes.text(x, y, str(number), ha="center", va="center_baseline", fontsize=8.5)
        digit.set(color=INK, weight="bold", zorder=9)
    return signs


def _close(
    axes: Axes,
    number: int,
    one: Difference,
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    resolution: float,
) -> list[Line2D]:
    """One beam at the scale of what decides; the place that it passes is the origin [µm]."""
    scale, half = 1e6, 1e6 * VIEW * resolution
    place = _decided(world, lrf, poses, one)
    beam = _beam(lrf, poses, one)
    left = np.array([-beam[1], beam[0]])
    # The beam is upright in the picture: what is ahead is up, what is to its left is left.
    turn = np.array([[beam[1], -beam[0]], [beam[0], beam[1]]])
    aside = float(np.dot(poses[one.scan, :2] - place, -left)) * scale
    axes.axvspan(aside - 0.5 * half, aside + 0.5 * half, color=BEAM, alpha=0.16, linewidth=0)
    ahead = float(np.dot(place - poses[one.scan, :2], beam))
    for answer, colour, width in ((one.embree, WRONG, 1.4), (one.planar, BEAM, 2.0)):
        stop = float(np.clip((answer[0] - ahead) * scale, -2.0 * half, 2.0 * half))
        axes.plot([aside, aside], [-2.0 * half, stop], color=colour, linewidth=width, zorder=3)
        axes.scatter(aside, stop, s=20, color=colour, linewidths=0, zorder=6)
    for wall in sorted({one.planar[1], one.embree[1]} - {-1}):
        ends = (world.segments[wall].reshape(2, 2) - place) @ turn.T * scale
        axes.plot(*ends.T, color=INK, linewidth=2.2, zorder=4)
        shown = ends[(np.abs(ends) < half).all(axis=1)]
        axes.scatter(shown[:, 0], shown[:, 1], s=22, color=INK, zorder=5)
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    axes.set_title(f"{number}  {one.cause}", loc="left", color=INK, fontsize=9.5, weight="bold")
    axes.set_xlabel(
        f"[µm]  exact {_range(one.planar)}, Embree {_range(one.embree)}", color=FAINT, fontsize=8
    )
    return [
        Line2D([], [], color=BEAM, alpha=0.3, linewidth=8, label="float32 cannot resolve"),
    ]


def _decided(world: World, lrf: LaserRangeFinder, poses: Float, one: Difference) -> Float:
    """Where the casters part (2,): the end of a wall that the beam passes by, or else a hit."""
    start, beam = poses[one.scan, :2], _beam(lrf, poses, one)
    walls = [wall for wall in (one.planar[1], one.embree[1]) if wall >= 0]
    ends = world.segments[walls].reshape(-1, 2)
    reach = [r for r in (one.planar[0], one.embree[0]) if np.isfinite(r)]
    hit: Float = start + min(reach, default=0.0) * beam
    if one.cause not in {Cause.WALL_END, Cause.CORNER_TIE} or not len(ends):
        return hit
    seen = ends - start
    nearest = np.abs(beam[0] * seen[:, 1] - beam[1] * seen[:, 0]).argmin()
    place: Float = ends[nearest]
    return place


def _beam(lrf: LaserRangeFinder, poses: Float, one: Difference) -> Float:
    beam: Float = lrf.directions(poses[one.scan])[one.beam]
    return beam


def _range(answer: tuple[float, int]) -> str:
    return f"{answer[0]:.3f} m" if np.isfinite(answer[0]) else "no return"
