"""The map beside a picture: from straight above, with its name, a legend and a scale."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from PIL import Image

from lrf3d.base.text import counted
from lrf3d.geometry.lines import Int, lengths
from lrf3d.studio.render.text import LINE, gap_of, length_of, row_of, scale_of, stacked
from lrf3d.studio.scene import look
from lrf3d.studio.scene.bodies import robots_of
from lrf3d.studio.scene.found import (
    false_after,
    false_words,
    found_after,
    has_false_walls,
    hits_on,
    lost_after,
    missed_by,
    visible_to,
)
from lrf3d.studio.scene.inset import InsetView
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.panel import INK, PALE
from lrf3d.studio.scene.shapes import NAMED, Inset, Lines, Pixels, level_lines
from lrf3d.studio.scene.subject import subject_of
from lrf3d.studio.scene.timeline import Moment, metres, smoothed

# What draws a map, of a size [pixels].
Draw = Callable[[Inset, tuple[int, int]], Pixels]

# Height of letters of maps that are compared [pixels of 720 lines].
_LARGE = 38.0

# Height of the letters under their title, in that of its own.
_LESSER = 0.65

# What is seen in them, until the last scan and after it.
_KEYS = (
    "dots: what the laser measures  ·  lines: the walls of its map",
    "dots: all that the laser measured of it  ·  red: not in the map",
)

# Half the thickness of the scale, in letters.
_BAR = 0.04

# Shares of the walls found, whose colours a legend shows.
_SHARES = np.linspace(0.0, 1.0, 4)

# Width of what a map shows around a wall that is missed [m].
_CLOSE = 4.0

# Time in which the map zooms in on that wall or on a drift [s of the film].
_NEARS = 1.2

# How long that is shown [s of the film].
_CLOSE_LASTS = 3.2

# Height of the outline of what is magnified [m].
_FRAMED = 0.02

# Corners of this outline, in half its size.
_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

# Colour of the frame of a map, 0…255.
_FRAME_COLOUR = (38, 50, 72)

# A usual number under a map, which chooses the size of all.
_USUAL = (("19 hits: ±16 cm  ·  missed", INK),)


class MapBeside:
    """The map of a scene's run as it grows.

    It takes at most a room, width and height [pixels]. One with a name says how many walls it has
    found, and shows those that it lacks in the end, unless other robots' maps may have them. Its
    walls and its robot may have colours.
    """

    def __init__(
        self,
        scene: Scene,
        room: tuple[int, int],
        letter: float,
        name: str = "",
        colours: Sequence[look.Colour] = (),
    ) -> None:
        wide, high = room
        self._scene = scene
        self.name = name
        # The wall that is shown close in the end with its hits (1, 4), in the world [m].
        self.close = look.NOTHING
        self._colours = colours if name else ()
        self._letter = letter
        # From when on a small drift is magnified [s], and the width of what is shown then [m].
        self.magnified = subject_of(scene.run, scene.timeline.playback).magnified * (not name)
        # Heights of the letters of the name and of the number.
        self.letters = [letter, letter]
        self.window = scene.inset_view(high / wide, turns=True, compared=bool(name))
        self.size = wide, min(high, round(wide * self.window.aspect))
        self._among_robots = bool(name and robots_of(scene.run.obstacles))

    def _window(self, time: float) -> InsetView:
        """What is shown at a time [s]: it zooms in on a small drift, or on a wall in the end."""
        timeline = self._scene.timeline
        # The last stop is shown for a while.
        since = float(timeline.run.trajectory.times.max())
        width = _CLOSE
        ends = self.close.reshape(-1, 2) - self._scene.origin
        if self.magnified and self._scene.drift:
            since, width = self.magnified
            ends = self._scene.drift.ends(time)[:, :2]
        if self.window.middle is None or not len(ends) or time <= since:
            return self.window
        whole = self.window.width
        share = smoothed(min((time - since) / (timeline.playback * _NEARS), 1.0))
        wide = whole * (width / whole) ** share
        # The place stays within what is shown.
        moved = (1.0 - wide / whole) / max(1.0 - width / whole, look.TINY)
        middle = self.window.middle + moved * (ends.mean(axis=0) - self.window.middle)
        return self.window._replace(middle=middle, width=wide, close=True)

    def frame(self, time: float) -> list[tuple[str, Lines]]:
        """The outline of what is magnified at a time [s], on the ground of the picture."""
        window = self._window(time)
        if not self.magnified or not window.close:
            return []
        middle = np.asarray(window.middle)
        corners = middle + _SQUARE @ np.linalg.inv(window.lens(middle).matrix[:2, :2]).T
        others = np.roll(corners, -1, axis=0)
        white = np.ones((len(corners), 3))
        return [("frame", level_lines(_FRAMED, corners, others, white, white[:, :2], look.BOLD))]

    @property
    def scale(self) -> float:
        """Pixels to a metre; 0 where only a part of the world is shown."""
        return self.size[0] / self.window.width * (self.window.middle is not None)

    def has_ended(self, time: float) -> bool:
        """Whether the map is whole at a time [s]."""
        timeline = self._scene.timeline
        return timeline.moment(time).mapped == len(timeline.run.trajectory.times) - 1

    def _title(self, moment: Moment, window: InsetView) -> str:
        """Whose map is shown at a moment, or what of it."""
        if self.name:
            return "Map of " * self._among_robots + self.name
        drift = self._scene.drift
        if drift and self.magnified and window.close:
            return f"Magnified {drift.words(moment, self._scene.timeline.playback)}"
        kind = "The map" if len(self._scene.run.maps) else "Seen"
        return kind + " so far" * (not self.has_ended(moment.time))

    def rows(self, time: float, draw: Draw) -> list[Image.Image]:
        """The name, the map and its number at a time [s], with what draws it."""
        run: Any = self._scene.run
        moment = self._scene.timeline.moment(time)
        ended = self.has_ended(time)
        found = found_after(run, moment.mapped) if self.name or ended else np.zeros(0, bool)
        false = false_after(run, moment.mapped) if len(found) else 0
        lost = look.NOTHING if self._among_robots else lost_after(run, moment.mapped)
        window = self._window(time)
        inset = self._scene.inset(moment, window, self._colours, lost)
        of = f" of {len(found)}" * (not self._among_robots)
        counts = f"{found.sum()}{of} walls"
        wrong = [f"{len(lost)} missed"] * bool(len(lost)) + [f"{false} false"] * bool(false)
        for wall in self.close[: int(ended)]:
            hits, off = hits_on(run, wall)
            counts = counted(len(hits), "hit") + f": ±{100 * off:.0f} cm" * bool(len(hits))
            wrong = ["missed"] * bool((lost == wall).all(axis=1).any())
            inset = inset._replace(marks=(*inset.marks, ("plan hits", self._scene.spots(hits))))
        plan = draw(inset, self.size)
        plan[[0, -1]] = plan[:, [0, -1]] = _FRAME_COLOUR
        tint, *_ = *self._colours, look.PALE_WALL
        name = self._title(moment, window), _ink(tint)
        red = [("·  " + ", ".join(wrong), _ink(look.FALSE_COLOUR))] * bool(wrong)
        if not self.name:
            return [self._row(name, *red), Image.fromarray(plan)]
        texts = zip(((name,), ((counts, INK), *red)), self.letters, strict=True)
        head, number = (row_of(words, letter, self.size[0]) for words, letter in texts)
        return [head, Image.fromarray(plan), *[number] * bool(len(found))]

    def legend(self, time: float) -> list[Image.Image]:
        """What is seen in maps at a time [s], and their scale."""
        window = self._window(time)
        run: Any = self._scene.run
        scan = self._scene.timeline.moment(time).mapped
        own = [*self._colours[:1]] or [*filter(None, self._scene.team.values())]
        segments = [(NAMED, _ink(tint)) for tint in own or look.gradient(_SHARES, look.FOUND)]
        seen = ("■", _ink(look.EXPLORED))
        robot = [self._row(("➤", _ink(look.ROBOT)), ("the robot", PALE))] * (not self._colours)
        long = round(window.bar / window.width * self.size[0])
        scale = Image.new("RGB", (self.size[0], round(LINE * self._letter)), look.PLAN_BACK)
        middle = scale.height // 2
        scale.paste(PALE, (0, middle, long, middle + 1 + round(_BAR * self._letter)))
        words = row_of(((f" {window.bar:g} m", PALE),), self._letter, self.size[0] - long)
        scale.paste(words, (long, 0), words)
        order = "walls in the map" if own else "walls, early to late"
        walls = [self._row(*segments, (order, PALE))] * (not self._among_robots)
        if (self._among_robots or not self._colours) and has_false_walls(run, scan):
            walls.append(self._row((NAMED, _ink(look.FALSE_COLOUR)), ("false walls", PALE)))
        if self.magnified and window.close:
            return [scale]
        return [
            *walls * bool(len(run.maps)),
            self._row(seen, ("seen by the laser", PALE)),
            *robot,
            scale,
        ]

    def _row(self, *words: Any) -> Image.Image:
        return row_of(words, self._letter, self.size[0])


class Comparison:
    """Maps of one drive under other conditions, by their names, as large as fits under a title.

    In the end they come close to the wall that most of them miss, which the title then names.
    """

    def __init__(self, scenes: Mapping[str, Scene], size: tuple[int, int], title: str) -> None:
        width, _ = size
        letter = _LARGE * scale_of(size)
        self.title = title
        self._gap = gap_of(size)
        self._head = round((1.0 + _LESSER) * LINE * letter) + self._gap
        self._size = size
        self.maps, self._cell = self._laid_out(scenes, letter)
        timelines = [each.timeline for each in scenes.values()]
        self.named: dict[str, Any] = {name: each.run for name, each in scenes.items()}
        runs = [*self.named.values()]
        parts, counts = missed_by(runs)
        # What all maps miss is not lost by more noise.
        self._lost = lengths(parts[counts < len(runs)])
        most = counts.max(initial=0)
        close = parts[counts == most][:1]
        for each in self.maps:
            each.close = close
            # All names are as large, and so are all numbers.
            texts = max((((each.name, INK),) for each in self.maps), key=length_of), _USUAL
            each.letters = [min(letter, each.size[0] / length_of(words)) for words in texts]
        # Until when the maps are shown [s], and not the world with what they miss.
        ends = [
            each.run.trajectory.times.max() + _CLOSE_LASTS * each.playback for each in timelines
        ]
        self.until = max(ends, default=-np.inf)
        by = f"by {most} of {len(runs)} maps"
        lost = [f"A wall of {metres(long)} is missed {by}" for long in lengths(close).tolist()]
        self._heads = [
            [
                row_of(((title, INK),), letter, width - 2 * self._gap),
                row_of(((key, PALE),), _LESSER * letter, width - 2 * self._gap),
            ]
            for title, key in zip(
                (title, *lost, title), (_KEYS[0], _KEYS[len(close)]), strict=False
            )
        ]

    def _laid_out(
        self, scenes: Mapping[str, Scene], letter: float
    ) -> tuple[list[MapBeside], tuple[int, int]]:
        """The maps, and the room of each: fewer rows where more do not show the world larger."""
        width, height = self._size
        count = max(1, len(scenes))
        # Each map has a name over it, and a number under it.
        text = round(2.0 * LINE * letter) + self._gap
        colours = look.PALE_WALL, look.TRAIL_COLOUR
        cells = [
            (width // -(-count // rows), (height - self._head) // rows)
            for rows in range(1, count + 1)
        ]
        laid_out = [
            [MapBeside(scene, room, letter, name, colours) for name, scene in scenes.items()]
            for room in np.maximum(np.array(cells) - [2 * self._gap, text], 1).tolist()
        ]
        return max(
            zip(laid_out, cells, strict=True),
            key=lambda each: max([one.scale for one in each[0]], default=0.0),
        )

    def card(self) -> tuple[str, ...]:
        """What is said in the end: what each map has, and whether the walls they miss are short."""
        runs = self.named.values()
        walls = [lengths(visible_to(run)[0]) for run in runs]
        lost = [lengths(lost_after(run, len(run) - 1)) for run in runs]
        # The picture is lit by the first drive.
        names = [each.name for each in self.maps]
        names[:1] = [f"{name} (this picture)" for name in names[:1]]
        rows = [
            f"{name}: {len(seen) - len(missed)} of {len(seen)} walls found"
            for name, seen, missed in zip(names, walls, lost, strict=True)
        ]
        longest = self._lost.max(initial=0.0)
        short = 0.0 < longest < max((np.median(seen) for seen in walls), default=0.0)
        head = "Short walls are lost in noise first" if short else self.title
        return (head, *rows) if sum(map(len, walls)) else ("",)

    def picture(self, time: float, draws: Iterable[Draw]) -> Pixels:
        """The maps (h, w, 3) at a time [s], each with what draws it."""
        head = self._heads[int(self.maps[0].has_ended(time))]
        picture = np.array(stacked(head, self._size, self._gap))
        wide, high = self._cell
        for number, (each, draw) in enumerate(zip(self.maps, draws, strict=True)):
            row, column = divmod(number, self._size[0] // wide)
            part = picture[self._head + row * high :, column * wide :]
            part[:high, :wide] = stacked(each.rows(time, draw), self._cell, self._gap)
        return picture


def together(team: Mapping[str, Scene], time: float) -> tuple[str, ...]:
    """What the maps of several robots hold at a time [s]: together, and each for itself.

    Nothing where no walls are known that they could see.
    """
    found, visible, false = zip(*(_found(scene, time) for scene in team.values()), strict=True)
    count = len(np.unique(np.concatenate(visible)))
    all_found = len(np.unique(np.concatenate(found)))
    each_found = (
        f"{name.capitalize()} alone: {len(own)} of {count}"
        for name, own in zip(team, found, strict=True)
    )
    robots = max(1 + len(robots_of(scene.run.obstacles)) for scene in team.values())
    of = f" of {robots} robots" * (robots > len(team))
    head = f"{len(team)} maps{of} together: {all_found} of {count} walls found"
    return (head + false_words(sum(false)), *each_found) if count else ("",)


def _found(scene: Scene, time: float) -> tuple[Int, Int, int]:
    """Walls of the world that a map has at a time [s], those it could have, and how many false."""
    run: Any = scene.run
    _, numbers = visible_to(run)
    scan = scene.timeline.moment(time).mapped
    return numbers[found_after(run, scan)], numbers, false_after(run, scan)


def _ink(colour: Iterable[float]) -> tuple[int, ...]:
    """A colour for text in whole numbers."""
    return tuple(round(look.WHITE * part) for part in colour)
