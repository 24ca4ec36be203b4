"""Worlds from meshes that trimesh reads, cut at the height of the beams.

The cut of the mesh with a level plane becomes walls; collinear ones are merged. Each has the height
of its triangles above the floor, which is z = 0, or else found. y is up in glTF, as specified, and
z in the other formats. Lengths are metres. Each named part of a scene is an object; in a file
without parts, walls that touch are one object.

A world is written as GLB: walls with their heights, a part for each object. glTF stores float32, so
vertices are relative to the world's origin, which is the translation of each part; y is up.
"""

import json
import re
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np
import shapely

from lrf3d.base.balance import Balance
from lrf3d.base.errors import WorldError, shown
from lrf3d.base.files import own_name, replacing
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, Int, number, quad_indices
from lrf3d.world.materials import material_of, material_value
from lrf3d.world.model import DEFAULT_HEIGHT, UNITS, World
from lrf3d.world.pieces import Part, connected, from_corner, walls, without_repeats, world_of_parts

if TYPE_CHECKING:
    import trimesh

# From z up to y up, as in glTF.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


# Height [m] of the cut above the floor, by default: that of the laser.
CUT = 0.5

# Least area of a floor, as a share of the largest level area of a mesh; tables are smaller.
FLOOR = 0.3

# Levels at which a wall is searched above the cut, and how far aside [m] it may stand there. More
# levels, and leaning walls, cost time and left more beams wrong in the worlds of others.
STEPS = 4
UPRIGHT_WITHIN = 0.01

# Shares of a length at a quarter from either end.
QUARTERS = (0.25, 0.75)


def read_mesh(path: Path, cut: float | None = None, scale: float = 1.0) -> World:
    """Read the cut of a mesh, enlarged by a scale, at a height [m] above its floor as walls.

    The floor is z = 0 if the mesh has walls at that height above it, and if it does not reach below
    or has a large level area there; it is found otherwise.
    """
    world, balance, said = cut_of_mesh(path, cut, scale)
    # Most of a mesh lies above or below its cut, which needs no note.
    for reason in LEVELS:
        balance.all -= balance.left_out.pop(reason, 0)
    balance.note(path, _size_doubt(world, scale), said)
    return world


# Reasons for leaving out triangles that do not cross the cut.
LEVELS = ("triangle above the cut", "triangle below the cut", "triangle within the cut")


# Least and largest height [m] of most walls of buildings, and of towns.
HEIGHTS = (0.3, 60.0)

# Least step between coordinates in single precision that is doubted, as a share of the height.
COARSE = 1e-3

# Matches a file that is text, or PLY in double precision.
EXACT = re.compile(rb"[^\0]*\Z|ply\s[^\0]*(double|float64) x")

# A mesh is doubted to lie on its side that is higher [m] than two storeys, and than this multiple
# of its width.
HIGH = 2.0 * DEFAULT_HEIGHT
SLENDER = 2.0


def _size_doubt(world: World, scale: float) -> str:
    """A doubt about a unit in which walls have no height of buildings, with the one that fits."""
    height = float(np.median(world.heights))
    wide, high = np.ptp(world.bounds, axis=0)
    if HEIGHTS[0] <= height <= HEIGHTS[1]:
        return ""
    unit = min(UNITS, key=lambda each: abs(np.log(each * height / DEFAULT_HEIGHT)))
    found = f"walls {height:,.4g} m high, {wide:,.6g} m by {high:,.6g} m?"
    size = f"{unit * wide:.3g} m by {unit * high:.3g} m, {unit * height:.2g} m high"
    return f"{found} --scale {unit * scale:g} if it is in {UNITS[unit]} ({size})"


def _rounding_doubt(path: Path, triangles: Float, scale: float) -> str:
    """A doubt about corners in single precision, which are coarse far from the origin."""
    step = float(np.spacing(np.abs(triangles).max().astype(np.float32)))
    fine = step < COARSE * np.ptp(triangles[..., 2])
    # Texts hold numbers of any precision, and glTF places its parts.
    if fine or path.suffix.lower() not in (".stl", ".ply") or EXACT.match(path.read_bytes()):
        return ""
    steps = f"corners in steps of {scale * step:.2g} m"
    return f"{steps}? move it to the origin before it is saved; "


def cut_of_mesh(
    path: Path, cut: float | None = None, scale: float = 1.0
) -> tuple[World, Balance, str]:
    """The world of a cut of a mesh, the balance of its triangles, and what was assumed."""
    balance = Balance("triangle")
    parts = _parts(path, balance)
    if not parts:
        held = f"; it holds {balance.words()}" if balance.left_out else ""
        raise WorldError(f"holds no triangle, so there is no wall{held}")
    given = np.concatenate([own for _, own in parts])
    triangles = scale * given
    part_of = np.repeat(np.arange(len(parts)), [len(own) for _, own in parts])
    above = CUT if cut is None else number(cut, "cut")
    for floor in floors_of(triangles):
        segments, face = level_cut(triangles, floor + above)
        if len(segments):
            break
    at_floor = f"{above:g} m above the floor, which is found at z = {floor:g} m"
    if not len(segments):
        raise WorldError(f"nothing stands {at_floor}; {_other_cut(triangles, floor)}")
    low = triangles[..., 2].min(axis=1)
    high = triangles[..., 2].max(axis=1)
    within = np.ones(len(triangles), dtype=bool)
    within[face] = False
    masks = [low > floor + above, high < floor + above]
    for reason, mask in zip(LEVELS, [*masks, within & ~masks[0] & ~masks[1]], strict=True):
        balance.leave(reason, int(mask.sum()))
    balance.used = len(np.unique(face))
    # Collinear to the resolution of float32.
    tolerance = 1e-6 * float(np.ptp(segments.reshape(-1, 2), axis=0).max())
    # Walls of one line and unequal heights stay apart.
    top = tops_of(triangles, segments, face, floor + above) - floor
    kinds = np.column_stack([part_of[face], np.round(top / tolerance)])
    kinds, first, kind = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    # Parts that do not reach the cut have no number.
    owners, numbers = np.unique(kinds[:, 0].astype(np.int64), return_inverse=True)
    found = [
        parts[owners[each]][0]._replace(
            number=int(each), segments=joined(segments[kind == row], tolerance), heights=top[at]
        )
        for row, (each, at) in enumerate(zip(numbers, first, strict=True))
    ]
    world = world_of_parts(found, own_name(path))
    if not (len(parts) > 1 or parts[0][0].name):
        world = World(world.segments, connected(world.segments), world.heights, world.name)
    said = _rounding_doubt(path, given, scale)
    said += f"cut {at_floor}; --cut sets the height" if floor else ""
    *sides, rise = np.ptp(triangles.reshape(-1, 3), axis=0)
    if rise > max(HIGH, SLENDER * min(sides)):
        said = (
            f"{rise:.3g} m high and {min(sides):.2g} m wide? save it with z up, or as .glb; {said}"
        )
    return world, balance, said.removesuffix("; ")


def floors_of(triangles: Float) -> tuple[float, float]:
    """The heights [m] that may be the floor of triangles (n, 3, 3), the likelier one first.

    One is the lowest large level area, or the lowest corner. The other is z = 0, unless the mesh
    reaches below and has no such area there: then it may be centred at z = 0.
    """
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = 0.5 * np.cross(edges[:, 0], edges[:, 1])
    area = np.abs(normals[:, 2])
    level = area > 0.99 * np.linalg.norm(normals, axis=1)
    # A slab has an upper and a lower side; corners may be ordered wrongly, so normals do not tell.
    heights, which = np.unique(
        np.round(triangles[level, :, 2].mean(axis=1), 2), return_inverse=True
    )
    areas = np.bincount(which, area[level])
    large = heights[areas >= FLOOR * areas.max(initial=0.0)]
    low = float(triangles[..., 2].min())
    # Two level areas less than half a metre apart are the sides of a slab; the upper one is the
    # floor.
    found = float(large[large <= large[0] + CUT][-1]) if len(large) else low
    ground = low >= -CUT or bool((np.abs(large) <= CUT).any())
    return (0.0 if ground else found), found


def _other_cut(triangles: Float, floor: float) -> str:
    """Advice: a height at which the cut meets walls, or the heights between which the mesh lies."""
    low = float(triangles[..., 2].min())
    high = float(triangles[..., 2].max())
    for share in (0.5, *QUARTERS):
        height = round(low + share * (high - low) - floor, 3)
        if len(level_cut(triangles, floor + height)[0]):
            return f"the mesh reaches from {low:g} to {high:g} m; --cut {height:g} meets walls"
    return f"the mesh reaches from {low:g} to {high:g} m"


def _parts(path: Path, balance: Balance) -> list[tuple[Part, Float]]:
    """The appearance of the parts of a scene, and their triangles (n, 3, 3) [m], z up.

    Counts all triangles, and leaves out parts that have none.
    """
    import trimesh

    if path.suffix.lower() == ".gltf":
        _check_buffers(path)
    y_up = path.suffix.lower() in (".glb", ".gltf")
    scene = load_scene(path)
    graph = scene.graph
    single = len(graph.nodes_geometry) == 1 and not y_up
    # The graph gives its nodes in any order; the file has its meshes in one.
    order = dict(zip(scene.geometry, range(len(scene.geometry)), strict=True))
    parts = []
    for node in sorted(graph.nodes_geometry, key=lambda n: (order[graph[n][1]], str(n))):
        matrix, key = graph[node]
        mesh = scene.geometry[key]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            balance.all += 1
            balance.leave(f"part without a triangle: {type(mesh).__name__}")
            continue
        balance.all += len(mesh.faces)
        vertices = trimesh.transform_points(np.asarray(mesh.vertices, dtype=np.float64), matrix)
        triangles = (vertices @ UPRIGHT if y_up else vertices)[mesh.faces]
        if not (np.abs(triangles) <= LARGEST_COORDINATE).all():
            far = f"has a vertex that is not finite, or over {LARGEST_COORDINATE:g} m away"
            raise WorldError(f"part {shown(str(node))} {far}")
        parts.append((_looks(mesh, "" if single else str(node)), triangles))
    return parts


def load_scene(path: Path, **options: Any) -> Any:
    """The scene that trimesh makes of a file, in which all meshes are as they are written."""
    import trimesh

    source: Any = path
    if path.suffix.lower() == ".obj":
        # Only materials of .obj files would read more files than this one.
        options = {"skip_materials": True, "file_type": "obj"}
        text = path.read_bytes()
        if re.search(rb"^[ \t]*f[ \t][^\n]*-", text, re.MULTILINE):
            source = BytesIO(_counted_forwards(text))
    return trimesh.load_scene(source, process=False, **options)


def _counted_forwards(text: bytes) -> bytes:
    """An OBJ file without faces that count vertices back from their line.

    trimesh counts them back from the last vertex of all.
    """
    whole = text.replace(b"\r\n", b"\n").replace(b"\\\n", b" ")
    lines = [line.partition(b"#")[0].split() for line in whole.splitlines()]
    known = 0
    for words in lines:
        known += words[:1] == [b"v"]
        if words[:1] == [b"f"]:
            corners = [int(word.partition(b"/")[0]) for word in words[1:]]
            words[1:] = [b"%d" % (each if each > 0 else known + 1 + each) for each in corners]
    return b"\n".join(map(b" ".join, lines))


def _looks(mesh: Any, name: str) -> Part:
    """A part without walls that looks like a mesh."""
    look = getattr(mesh.visual, "material", None)
    factor = getattr(look, "baseColorFactor", None)
    colour = None if factor is None else np.asarray(factor[:3]) / 255
    # The material that lrf3d wrote, or else the built-in one of the name that the mesh's own has.
    written = material_of(mesh.metadata.get("material"))
    material = written or material_of(str(getattr(look, "name", None)).lower())
    return Part(0, np.empty((0, 4)), np.empty(0), name, colour, material)


def _check_buffers(path: Path) -> None:
    """Check that the files exist in which a glTF stores its arrays."""
    missing = list[str]()
    # Other errors are reported by the reader.
    with suppress(ValueError, LookupError, TypeError, AttributeError, RecursionError):
        uris = [each.get("uri", "data:") for each in json.loads(path.read_bytes())["buffers"]]
        names = [unquote(uri) for uri in uris if not uri.startswith("data:")]
        missing += [name for name in names if not (path.parent / name).is_file()]
    if missing:
        raise WorldError(f"needs {shown(missing[0])}; put that file next to it, or save it as .glb")


def joined(segments: Float, tolerance: float) -> Float:
    """Segments (n, 4) joined where they go straight on."""
    lines = shapely.linestrings(segments[without_repeats(segments)].reshape(-1, 2, 2))
    found = []
    for chain in shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines))):
        opened = shapely.linestrings(from_corner(shapely.get_coordinates(chain)))
        found.append(walls(shapely.get_coordinates(shapely.simplify(opened, tolerance))))
    return np.concatenate(found)


def level_cut(triangles: Float, height: float) -> tuple[Float, Int]:
    """Where triangles (n, 3, 3) meet the level plane at a height [m].

    The cuts (m, 4) are segments x1 y1 x2 y2 [m], each of one of the triangles (m,). They are
    rounded to float64, to the same bits for both triangles at an edge, so that no beam passes
    between them, and not at all on upright edges. Triangles within the plane have no cut.
    """
    near = (triangles[:, :, 2].min(axis=1) <= height) & (triangles[:, :, 2].max(axis=1) >= height)
    faces = np.flatnonzero(near)
    corners = triangles[faces]
    side = np.sign(corners[:, :, 2] - height)
    # The lower end of an edge is the same for both of its triangles.
    one = corners
    other = np.roll(corners, -1, axis=1)
    swap = (one[:, :, 2] > other[:, :, 2])[:, :, None]
    low = np.where(swap, other, one)
    high = np.where(swap, one, other)
    crosses = side * np.roll(side, -1, axis=1) < 0.0
    rise = np.where(crosses, high[:, :, 2] - low[:, :, 2], 1.0)
    share = ((height - low[:, :, 2]) / rise)[:, :, None]
    middle = low[:, :, :2] + share * (high[:, :, :2] - low[:, :, :2])
    # A triangle has two of these six points, unless it lies in the plane or touches it in a corner.
    points = np.concatenate([middle, corners[:, :, :2]], axis=1)
    meets = np.concatenate([crosses, side == 0.0], axis=1)
    cut = meets.sum(axis=1) == 2
    segments = points[cut][meets[cut]].reshape(-1, 4)
    long = (segments[:, :2] != segments[:, 2:]).any(axis=1)
    return segments[long], faces[cut][long]


def tops_of(triangles: Float, segments: Float, faces: Int, cut: float) -> Float:
    """Heights [m] up to which walls (m,) stand upright, given their cuts and faces of `level_cut`.

    Triangles (n, 3, 3) end at the edges of a mesh, walls at the first level of a few above the cut
    at which nothing stands on them. What stands on a wall runs along it, and begins at its top.
    """
    tops: Float = triangles[faces, :, 2].max(axis=1)
    begin, end = np.hsplit(segments, 2)
    quarters = [shapely.points(begin + share * (end - begin)) for share in QUARTERS]
    rising = np.arange(len(tops))
    for level in np.linspace(cut, triangles[..., 2].max(), STEPS, endpoint=False) + UPRIGHT_WITHIN:
        lower = rising[tops[rising] < level]
        standing, own = level_cut(triangles, level)
        tree = shapely.STRtree(shapely.linestrings(standing.reshape(-1, 2, 2)))
        heights = triangles[own, :, 2]
        low, high = heights.min(axis=1), heights.max(axis=1)
        found = np.full((2, len(lower)), -np.inf)
        for raised, points in zip(found, quarters, strict=True):
            wall, on = tree.query(points[lower], predicate="dwithin", distance=UPRIGHT_WITHIN)
            stands = low[on] <= tops[lower[wall]] + UPRIGHT_WITHIN
            np.maximum.at(raised, wall[stands], high[on[stands]])
        tops[lower] = np.maximum(tops[lower], found.min(axis=0))
        rising = rising[tops[rising] >= level]
    return tops


def upright(world: World) -> Float:
    """The corners (n, 4, 3) [m] of the walls: along the ground, and back along the top."""
    ends = world.segments.reshape(-1, 2, 2)
    corners = np.zeros((len(ends), 4, 3))
    corners[:, :2, :2] = ends
    corners[:, 2:, :2] = ends[:, ::-1]
    corners[:, 2:, 2] = world.heights[:, None]
    return corners


def extrude(world: World) -> "trimesh.Trimesh":
    """Raise every wall from the ground, z = 0, to its height.

    Triangles 2i and 2i + 1 are wall i. ``world.origin`` is subtracted from x and y, so that float32
    casters lose no digits.
    """
    import trimesh

    vertices = upright(world).reshape(-1, 3) - [*world.origin, 0.0]
    faces = quad_indices(len(world.segments)).reshape(-1, 3)
    # Processing would merge vertices and drop faces, and so break the numbering of the faces.
    return trimesh.Trimesh(vertices, faces, process=False)


def write_glb(world: World, path: Path) -> None:
    """Write a world as GLB."""
    import trimesh

    visual: Any = trimesh.visual
    scene: Any = trimesh.Scene()
    whole = extrude(world)
    turned = (np.asarray(whole.vertices) @ UPRIGHT.T).reshape(-1, 4, 3)
    to_source = np.eye(4)
    to_source[:3, 3] = UPRIGHT @ [*world.origin, 0.0]
    for owner in np.unique(world.objects).tolist():
        own = world.objects == owner
        colour = world.colours[owner]
        # Walls without a colour are light grey.
        shade = np.append(np.where(np.isfinite(colour), colour, 0.78), 1.0)
        look = visual.material.PBRMaterial(
            baseColorFactor=shade, metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True
        )
        mesh = trimesh.Trimesh(
            turned[own].reshape(-1, 3),
            whole.faces[: 2 * own.sum()],
            process=False,
            visual=visual.TextureVisuals(material=look),
        )
        material = world.materials[owner] if world.materials else None
        if material is not None:
            look.name = material.name
            mesh.metadata["material"] = material_value(material)
        name = world.object_names[owner] if world.object_names else ""
        if not name or name in scene.graph.nodes:
            name = f"{name or 'object'} {owner}"
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=to_source)
    with replacing(path) as unfinished:
        unfinished.write_bytes(bytes(scene.export(file_type="glb")))
