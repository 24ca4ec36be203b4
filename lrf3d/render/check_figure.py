"""Check figure: the place where a solved drive contradicts itself, as both of its passes saw it.

Key scans at the poses that were found and the self-check enter; a picture leaves: what the worst
stretch saw, what other passes saw there, and both, with the closures there that were refused.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lrf3d.geometry import Float
from lrf3d.render.figures import finished, metre_sheet
from lrf3d.slam.checks import LATER, SelfCheck
from lrf3d.slam.closures import Refusal
from lrf3d.slam.key_scans import Key
from lrf3d.slam.surface import SURFACE, moved

NEW, OLD, REFUSED = "#d6361f", "#2f6fb3", "#7a3fb0"
"""Colours of what the stretch saw, of what other passes saw, and of refused closures."""

AROUND = 6.0
"""Key scans of other passes up to this far from the stretch [m] are drawn."""


def draw_check(
    keys: Sequence[Key],
    poses: Float,
    check: SelfCheck,
    refused: Sequence[Refusal],
    title: str,
    path: str | Path | None = None,
) -> Figure:
    """Draw the worst stretch of a drive, at poses (k, 3) of its key scans.

    Raises:
        OutputError: The picture cannot be written.
    """
    first, last = check.worst_scans
    scans = np.array([key.scan for key in keys])
    inside = (scans >= first) & (scans <= last)
    low, high = poses[inside, :2].min(axis=0) - AROUND, poses[inside, :2].max(axis=0) + AROUND
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    begin, end = driven[inside].min() - LATER, driven[inside].max() + LATER
    others = ((driven < begin) | (driven > end)) & (
        (poses[:, :2] > low) & (poses[:, :2] < high)
    ).all(axis=1)
    names = f"scans {first} to {last}", "scans of other passes"
    share = f"{100.0 * check.worst_violation:.0f} % of what others saw is passed by beams"
    words = (
        f"scans {first} to {last}: {share}" if check.worst_violation else f"scans {first} to {last}"
    )
    figure, axes = metre_sheet([np.array([low, high])], 3, title, words)
    for ax, shown in zip(axes, ((0,), (1,), (1, 0)), strict=True):
        for number in shown:
            rows = np.flatnonzero((inside, others)[number]).tolist()
            seen = [moved(keys[k].surface, poses[k]) for k in rows]
            points = np.concatenate([np.empty(0, SURFACE), *seen])
            ax.plot(
                points["x"], points["y"], ".", markersize=1.5, color=(NEW, OLD)[number],
                label=names[number], zorder=3,
            )  # fmt: skip
        ax.plot(*poses[inside, :2].T, color=NEW, linewidth=0.8, zorder=4)
    ends = [poses[[each.old, each.new], :2] for each in refused]
    axes[2].add_collection(
        LineCollection(ends, colors=REFUSED, linewidths=0.9, label="refused closures", zorder=5)
    )
    for row, why in enumerate(dict.fromkeys(each.why for each in refused)):
        pairs = [f"{scans[each.old]}:{scans[each.new]}" for each in refused if each.why == why]
        words = f"{len(pairs)} refused, such as {pairs[0]}: {why}"
        axes[2].text(
            0.02, 0.97 - 0.05 * row, words, transform=axes[2].transAxes, va="top", color=REFUSED,
            fontsize=7,
        )  # fmt: skip
    return finished(figure, axes, path)
