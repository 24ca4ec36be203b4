"""Worlds from meshes that trimesh reads, cut at the height of the beams.

The cut of the mesh with the plane z = ``cut`` becomes walls; collinear ones are merged. Each
has the height of its triangles. In glTF y is up, as its specification says, in the other formats z
is. Lengths are metres. Each named part of a scene is an object; in a file without parts, walls that
touch are one object.

A world is written as GLB: walls with their heights, a part for each object. glTF holds float32, so
vertices are relative to the world's origin, which is the translation of each part; y is up.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from lrf3d.base.errors import WorldError, shown
from lrf3d.base.files import own_name, replacing
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, Int, quad_indices
from lrf3d.world.materials import material_of, material_value
from lrf3d.world.model import World
from lrf3d.world.pieces import Part, connected, from_corner, walls, without_repeats, world_of_parts

if TYPE_CHECKING:
    import trimesh

# From z up to y up, as in glTF.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def read_mesh(path: Path, cut: float = 0.5) -> World:
    """Read the cut of a mesh at a height [m], by default that of the laser, as walls."""
    parts = _parts(path)
    if not parts:
        raise WorldError("holds no triangle, so there is no wall")
    triangles = np.concatenate([own for _, own in parts])
    part_of = np.repeat(np.arange(len(parts)), [len(own) for _, own in parts])
    segments, face = level_cut(triangles, cut)
    if not len(segments):
        reach = f"{triangles[..., 2].min():g} to {triangles[..., 2].max():g} m"
        raise WorldError(f"nothing stands at a height of {cut:g} m; the mesh reaches from {reach}")
    # Collinear to the resolution of float32.
    tolerance = 1e-6 * max(float(np.ptp(segments.reshape(-1, 2), axis=0).max()), 1e-3)
    # Walls of one line and unequal heights stay apart.
    top = triangles[face, :, 2].max(axis=1)
    kinds = np.column_stack([part_of[face], np.round(top / tolerance)])
    kinds, first, kind = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    # Parts that do not reach the cut have no number.
    owners, numbers = np.unique(kinds[:, 0].astype(np.int64), return_inverse=True)
    found = [
        parts[owners[number]][0]._replace(
            number=int(number), segments=_joined(segments[kind == row], tolerance), heights=top[at]
        )
        for row, (number, at) in enumerate(zip(numbers, first, strict=True))
    ]
    world = world_of_parts(found, own_name(path))
    if len(parts) > 1 or parts[0][0].name:
        return world
    return World(world.segments, connected(world.segments), world.heights, world.name)


def _parts(path: Path) -> list[tuple[Part, Float]]:
    """The looks of the parts of a scene, and their triangles (n, 3, 3) [m], z up."""
    import trimesh

    y_up = path.suffix.lower() in (".glb", ".gltf")
    # Only materials of .obj files would read more files than this one.
    options: dict[str, Any] = {"skip_materials": True} if path.suffix.lower() == ".obj" else {}
    scene = trimesh.load_scene(path, process=False, **options)
    graph = scene.graph
    single = len(graph.nodes_geometry) == 1 and not y_up
    # The graph gives its nodes in any order; the file has its meshes in one.
    order = dict(zip(scene.geometry, range(len(scene.geometry)), strict=True))
    parts = []
    for node in sorted(graph.nodes_geometry, key=lambda n: (order[graph[n][1]], str(n))):
        matrix, key = graph[node]
        mesh = scene.geometry[key]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        vertices = trimesh.transform_points(np.asarray(mesh.vertices, dtype=np.float64), matrix)
        triangles = (vertices @ UPRIGHT if y_up else vertices)[mesh.faces]
        if not (np.abs(triangles) <= LARGEST_COORDINATE).all():
            far = f"has a vertex that is not finite, or over {LARGEST_COORDINATE:g} m away"
            raise WorldError(f"part {shown(str(node))} {far}")
        parts.append((_looks(mesh, "" if single else str(node)), triangles))
    return parts


def _looks(mesh: Any, name: str) -> Part:
    """A part without walls that looks like a mesh."""
    look = getattr(mesh.visual, "material", None)
    factor = getattr(look, "baseColorFactor", None)
    colour = None if factor is None else np.asarray(factor[:3]) / 255.0
    # The material that lrf3d wrote, or else the built-in one of the name that the mesh's own has.
    written = material_of(mesh.metadata.get("material"))
    material = written or material_of(str(getattr(look, "name", None)).lower())
    return Part(0, np.empty((0, 4)), np.empty(0), name, colour, material)


def _joined(segments: Float, tolerance: float) -> Float:
    """Segments (n, 4) joined where they go straight on."""
    lines = shapely.linestrings(segments[without_repeats(segments)].reshape(-1, 2, 2))
    joined = []
    for chain in shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines))):
        opened = shapely.linestrings(from_corner(shapely.get_coordinates(chain)))
        joined.append(walls(shapely.get_coordinates(shapely.simplify(opened, tolerance))))
    return np.concatenate(joined)


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
    for number in np.unique(world.objects).tolist():
        own = world.objects == number
        colour = world.colours[number]
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
        material = world.materials[number] if world.materials else None
        if material is not None:
            look.name = material.name
            mesh.metadata["material"] = material_value(material)
        name = world.object_names[number] if world.object_names else ""
        if not name or name in scene.graph.nodes:
            name = f"{name or 'object'} {number}"
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=to_source)
    with replacing(path) as unfinished:
        unfinished.write_bytes(bytes(scene.export(file_type="glb")))
