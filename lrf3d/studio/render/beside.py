"""The map beside a picture: from straight above, with its name, a legend and a scale."""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np

from lrf3d.geometry.lines import Bool, Float
from lrf3d.mapping.tints import object_tints
from lrf3d.scoring.map_score import found_walls, judged_part, visible_walls
from lrf3d.studio.render.text import Words, row_of
from lrf3d.studio.scene import look
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.shapes import NAMED, Inset, Pixels
from lrf3d.studio.scene.timeline import Moment

# Height of letters [pixels of 720 lines].
LETTER = 25.0

# Width of the frame of a map, and of its scale, in letters.
_FRAME = 0.08

# Colour of that frame, 0…255.
_FRAME_COLOUR = (38, 50, 72)

# Colour of the first row, 0…255.
INK = (236, 240, 247)

# Colour of the other rows, 0…255.
_PALE = (184, 196, 216)


class MapBeside:
    """The map of a scene's run as it grows.

    It takes at most a room, width and height [pixels]. One with a name says how many walls it has
    found, and shows those that it lacks in the end. Its walls and its robot may have colours.
    """

    def __init__(
        self,
        scene: Scene,
        room: tuple[int, int],
        letter: float,
        name: str = "",
        colours: tuple[look.Colour, look.Colour] | None = None,
    ) -> None:
        run: Any = scene.run
        wide, high = room
        self._scene = scene
        self.name = name
        self._colours = colours
        self._letter = letter
        self._rim = max(1, round(_FRAME * letter))
        self.window = scene.inset_view(high / wide, turns=True)
        self.size = wide, min(high, round(wide * self.window.aspect))
        known = bool(name and run.knows_truth and len(run.maps) and len(run.world.segments))
        self._walls = visible_walls(judged_part(run))[0] if known else np.zeros((0, 4))
        self._found = cache(self._found_by)

    def rows(self, time: float, draw: Callable[[Inset, tuple[int, int]], Pixels]) -> list[Pixels]:
        """The name, the map and its number at a time [s], with what draws it."""
        moment = self._scene.timeline.moment(time)
        lost = self._lost(moment)
        plan = draw(self._scene.inset(moment, self.window, self._colours, lost), self.size)
        for edge in plan[: self._rim], plan[-self._rim :], plan[:, : self._rim]:
            edge[:] = _FRAME_COLOUR
        plan[:, -self._rim :] = _FRAME_COLOUR
        named = self._row(
            (self.name or "The map so far", _ink(self._colours[0] if self._colours else look.CLAY))
        )
        if not len(self._walls):
            return [named, plan]
        found = int(self._found(self._number(moment)).sum())
        counts: Words = ((f"{found} of {len(self._walls)} walls found", INK),)
        if len(lost):
            counts += ((f"· {len(lost)} missed", _ink(look.FALSE_COLOUR)),)
        return [named, plan, self._row(*counts)]

    def legend(self) -> list[Pixels]:
        """What is seen in maps, and their scale."""
        tints = (
            object_tints(np.arange(3), dark=True) if self._colours is None else self._colours[:1]
        )
        segments = [(NAMED, _ink(tint)) for tint in tints]
        seen = ("■", tuple(2 * part for part in _ink(look.EXPLORED)))
        rows = [
            self._row(*segments, ("walls in the map", _PALE)),
            self._row(seen, ("seen by the laser", _PALE)),
        ]
        if self._colours is None:
            rows.append(self._row(("➤", _ink(look.ROBOT)), ("the robot", _PALE)))
        wide, _ = self.size
        long = round(self.window.bar / self.window.width * wide)
        words = row_of(((f" {self.window.bar:g} m", _PALE),), self._letter, wide - long)
        bar = np.full((len(words), long, 3), look.PLAN_BACK, np.uint8)
        bar[len(bar) // 2 :][: self._rim] = _PALE
        return [*rows, np.hstack([bar, words])]

    def _row(self, *words: Any) -> Pixels:
        return row_of(words, self._letter, self.size[0])

    def _number(self, moment: Moment) -> int:
        return self._scene.run.snapshot_after(moment.mapped)

    def _found_by(self, number: int) -> Bool:
        """Which of the walls (v,) the map of a number has found."""
        if number < 0:
            return np.zeros(len(self._walls), bool)
        return found_walls(self._scene.run.maps[number], self._walls)

    def _lost(self, moment: Moment) -> Float:
        """The walls (n, 4) that the last map lacks, once it is there."""
        number = self._number(moment)
        if moment.mapped < len(self._scene.run.trajectory.times) - 1:
            return self._walls[:0]
        return self._walls[~self._found(number)]


def stacked(rows: list[Pixels], size: tuple[int, int], gap: int) -> Pixels:
    """Rows (h, w, 3) one under the other on the ground of maps, of a size, with a gap [pixels]."""
    wide, high = size
    picture = np.full((high, wide, 3), look.PLAN_BACK, np.uint8)
    top = gap // 2
    for row in rows:
        part = picture[top : top + len(row), gap : gap + row.shape[1]]
        part[:] = row[: len(part), : part.shape[1]]
        top += len(row)
    return picture


def _ink(colour: Iterable[float]) -> tuple[int, ...]:
    """A colour for text in whole numbers."""
    return tuple(round(look.WHITE * part) for part in colour)
