"""The strokes of a plan as a table: what each was taken for, and by which rule.

The user's decisions change this table, from which the plan is then made again.
"""

from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.plans.canvas import Mark
from lrf3d.plans.rules.strokes import Strokes
from lrf3d.world import World
from lrf3d.world.materials import named
from lrf3d.world.model import DEFAULT_HEIGHT

# Height of furniture [m], such as tables and kitchen units.
FURNITURE_HEIGHT = 0.8

# What a stroke may be taken for, and its height [m]; 0 if it is no obstacle.
KINDS = {
    "wall": DEFAULT_HEIGHT,
    "furniture": FURNITURE_HEIGHT,
    "glass": DEFAULT_HEIGHT,
    "mirror": DEFAULT_HEIGHT,
    "door": 0.0,
    "nothing": 0.0,
}

# Object number of a stroke that belongs to the object of the walls that it touches.
TOUCHED = -1


class Parts(NamedTuple):
    """Strokes (n, 4) [m], with columns (n,) of their properties."""

    segments: Float
    # Keys of `KINDS`.
    kinds: Any
    # Heights [m] of those that stand.
    heights: Float
    # Names of materials; empty for plaster.
    materials: Any
    # The rule that decided, or ``drawn``; empty if the layer decided, or nothing.
    rules: Any
    layers: Any
    # As ``#rrggbb``; empty where they are not known.
    colours: Any
    # The object of a world; `TOUCHED` otherwise.
    objects: Int
    # The middles (n, 2) [m] of the strokes that these were cut from; NaN for uncut ones.
    uncut_middles: Float

    @classmethod
    def of(cls, segments: Float, kind: str, **columns: Any) -> "Parts":
        """Strokes (n, 4) of one kind; other columns are given as one value, or one a stroke."""
        usual = {
            "kinds": kind,
            "heights": KINDS[kind],
            "materials": kind if kind in ("glass", "mirror") else "",
            "rules": "",
            "layers": "",
            "colours": "",
            "objects": TOUCHED,
        }
        kinds = {"heights": np.float64, "objects": np.int64}
        filled = {name: np.empty(len(segments), kinds.get(name, object)) for name in usual}
        for name, column in filled.items():
            column[:] = columns.get(name, usual[name])
        return cls(
            np.asarray(segments, dtype=np.float64).reshape(-1, 4),
            **filled,
            uncut_middles=np.full((len(segments), 2), np.nan),
        )

    @property
    def middles(self) -> Float:
        """The middles (n, 2) [m] of the strokes."""
        return np.asarray(self.segments.reshape(-1, 2, 2).mean(axis=1))

    @classmethod
    def of_world(cls, world: World) -> "Parts":
        """The walls of a world."""
        made = [None] * world.object_count
        materials = ["" if each is None else each.name for each in world.materials or made]
        names = list(world.object_names or [""] * world.object_count)
        each = world.objects
        return cls.of(
            world.segments,
            "wall",
            heights=world.heights,
            materials=np.array(materials, dtype=object)[each],
            layers=np.array(names, dtype=object)[each],
            objects=each,
        )

    @property
    def stands(self) -> Any:
        """Which strokes (n,) stand in the world."""
        return np.array([KINDS[kind] > 0.0 for kind in self.kinds], dtype=bool)

    def joined(self, *others: "Parts") -> "Parts":
        """These strokes, followed by others."""
        return Parts(*map(np.concatenate, zip(self, *others, strict=True)))

    def at(self, rows: Any) -> "Parts":
        """The strokes of some rows."""
        return Parts(*(column[rows] for column in self))


def parts_of(strokes: Strokes, marks: list[Mark], walls: Float, own: Int, role: Any) -> Parts:
    """The walls, each with its mark (n,) and its role (n,), and the strokes that rules took out."""
    layers = np.array([mark.layer for mark in marks] or [""], dtype=object)
    colours = np.array([mark.colour for mark in marks] or [""], dtype=object)

    def part(segments: Float, kind: str, mark: Int, **columns: Any) -> Parts:
        return Parts.of(segments, kind, layers=layers[mark], colours=colours[mark], **columns)

    furniture = role == "furniture"
    kinds = np.where(furniture, "furniture", "wall").astype(object)
    heights = np.where(furniture, FURNITURE_HEIGHT, DEFAULT_HEIGHT)
    found = [part(walls, "wall", own, kinds=kinds, heights=heights)]
    for name, each in strokes.found.items():
        door = each & ((strokes.role == "door") | (name == "door stroke"))
        found += [
            part(strokes.segments[chosen], kind, strokes.piece[chosen], rules=name)
            for kind, chosen in (("door", door), ("nothing", each & ~door))
        ]
    return found[0].joined(*found[1:])


def world_of_parts(parts: Parts, world: World, base: World | None) -> World:
    """A world of the strokes that stand, each object with one material.

    Walls that touch are one object; walls of a base world keep their objects.
    """
    count = 0 if base is None else base.object_count
    own = np.where(parts.objects >= 0, parts.objects, world.objects + count)
    keys = [*zip(own.tolist(), parts.materials.tolist(), strict=True)]
    number = {key: place for place, key in enumerate(sorted(set(keys)))}
    known = [key[0] if key[0] < count else None for key in number]
    colours = np.full((len(number), 3), np.nan)
    names = [""] * len(number)
    for place, old in enumerate(known):
        if base is not None and old is not None:
            colours[place] = base.colours[old]
            names[place] = base.object_names[old] if base.object_names else ""
    made = [] if base is None else [each for each in base.materials if each is not None]
    materials = [named(name, made) if name else None for _, name in number]
    kept = {} if base is None else {name: getattr(base, name) for name in ("place", "free")}
    return World(
        parts.segments,
        [number[key] for key in keys],
        parts.heights,
        world.name,
        object_names=names if any(names) else (),
        colours=colours,
        materials=materials if any(materials) else None,
        cameras=() if base is None else base.cameras,
        **kept,
    )
