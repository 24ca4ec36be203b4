"""Worlds as TOML text, which is read again to the last bit.

A world enters; a text or a file leaves.
"""

from pathlib import Path

import numpy as np

from lrf3d.files import write_text
from lrf3d.geometry import Float
from lrf3d.world.cameras import FixedCamera
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.materials import BUILT_IN, Material
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import WallRun, parts_of
from lrf3d.world.schema import colour_value


def write_toml(world: World, path: Path) -> None:
    """Write a world as TOML.

    Raises:
        OutputError: The file cannot be written.
    """
    write_text(path, toml_text(world))


def toml_text(world: World) -> str:
    """The TOML text of a world."""
    blocks = [f"name = {_quoted(world.name)}\n"]
    if world.place is not None:
        blocks[0] += f"place = [{world.place[0]!r}, {world.place[1]!r}]\n"
    described: set[int] = set()
    expected = 0
    for part in [*_objects_without_walls(world), *parts_of(world)]:
        lines = ["[[object]]"]
        if part.number != expected:
            lines.append(f"number = {part.number}")
        expected = part.number + 1
        if part.number not in described:
            lines += _description(world, part.number)
        described.add(part.number)
        lines += _outline(part)
        if len(part.heights) and part.height_value != DEFAULT_HEIGHT:
            lines.append(f"height = {part.height_value!r}")
        blocks.append("\n".join(lines) + "\n")
    blocks += [_material(material) for material in _own_materials(world)]
    blocks += [_camera(camera) for camera in world.cameras]
    if world.free is not None:
        blocks.append(_free(world.free))
    return "\n".join(blocks)


def _own_materials(world: World) -> list[Material]:
    """The materials of a world that are not built in, each once."""
    used = dict.fromkeys(material for material in world.materials if material is not None)
    return [material for material in used if BUILT_IN.get(material.name) != material]


def _material(material: Material) -> str:
    values = material.as_dict()
    lines = [f"name = {_quoted(values.pop('name'))}"]
    lines += [f"{key} = {value!r}" for key, value in values.items()]
    return "[[material]]\n" + "\n".join(lines) + "\n"


def _camera(camera: FixedCamera) -> str:
    return (
        f"[[camera]]\nname = {_quoted(camera.name)}\n"
        f"position = {list(camera.position)!r}\ntarget = {list(camera.target)!r}\n"
        f"field_deg = {camera.field_deg!r}\n" + ("track = true\n" if camera.track else "")
    )


def _free(free: FreeCells) -> str:
    values = free.as_dict()
    rows = "".join(f"    {row},\n" for row in values["rows"])
    return (
        "# Cells that are known to be free: each row, from the bottom, as the lengths of its runs\n"
        "# that are not free, and free, in turn.\n"
        f"[free]\nresolution = {values['resolution']!r}\norigin = {values['origin']!r}\n"
        f"rows = [\n{rows}]\n"
    )


def _objects_without_walls(world: World) -> list[WallRun]:
    """Objects with a name or a colour but without walls, so that they are not lost."""
    bare = set(range(world.object_count)) - set(world.objects.tolist())
    return [WallRun(n, (), np.empty(0)) for n in sorted(bare) if _description(world, n)]


def _description(world: World, number: int) -> list[str]:
    lines = []
    if number < len(world.object_names) and world.object_names[number]:
        lines.append(f"name = {_quoted(world.object_names[number])}")
    if number < len(world.colours) and np.isfinite(world.colours[number]).all():
        value = colour_value(world.colours[number])
        lines.append(f"colour = {_quoted(value) if isinstance(value, str) else repr(value)}")
    material = world.materials[number] if world.materials else None
    if material is not None:
        lines.append(f"material = {_quoted(material.name)}")
    return lines


def _outline(part: WallRun) -> list[str]:
    closed = bool(part.pieces) and all(piece.closed for piece in part.pieces)
    texts = [_points(piece.points if closed else piece.outline) for piece in part.pieces]
    lines = [f"points = {texts[0]}"] if len(texts) == 1 else [f"lines = [{', '.join(texts)}]"]
    return [*lines, "closed = true"] if closed else lines


def _points(points: Float) -> str:
    return "[" + ", ".join(f"[{float(x)!r}, {float(y)!r}]" for x, y in points) + "]"


def _quoted(value: str) -> str:
    # The name of a file may hold half a pair of surrogates, which no text can.
    value = value.encode(errors="replace").decode()
    escapes = {'"': '\\"', "\\": "\\\\"}
    return (
        '"' + "".join(escapes.get(c, c if _plain(c) else f"\\u{ord(c):04x}") for c in value) + '"'
    )


def _plain(character: str) -> bool:
    return character >= " " and character != "\x7f"
