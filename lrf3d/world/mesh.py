"""Worlds from meshes that trimesh reads, cut at the height of the beams.

The cut of the mesh with the plane z = :data:`CUT` becomes walls; collinear ones are merged. Each
has the height of its triangles. In glTF y is up, as its specification says, in the other formats z
is. Lengths are metres. Each named part of a scene is an object; in a file without parts, walls that
touch are one object.

A world is written as GLB: walls with their heights, a part for each object. glTF holds float32, so
vertices are relative to the world's origin, which is the translation of each part; y is up.
"""

import json
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.files import opened, own_name, replacing
from lrf3d.geometry import LARGEST_COORDINATE, Float, Int, lengths
from lrf3d.world.collinear import merge_collinear
from lrf3d.world.extrude import extrude
from lrf3d.world.materials import Material, material_of, material_value
from lrf3d.world.model import World
from lrf3d.world.touching import connected

CUT = 0.5
"""Height [m] at which a mesh is cut: the default height of the laser."""

LARGEST_MESH = 1 << 27
"""Largest size of a mesh with all files that it refers to [bytes]."""

FLAT = 1e-6
"""Tolerance for collinear cuts, relative to the extent: the resolution of float32."""

UPRIGHT_Y = {".glb", ".gltf"}
"""Formats in which y is up."""


PLAIN = 0.78
"""Grey of walls without a colour."""


def read_mesh(path: Path, *, cut: float = CUT) -> World:
    """Read the cut of a mesh at a height as walls.

    Args:
        path: The file: ``.glb``, ``.gltf``, ``.obj``, ``.off``, ``.ply`` or ``.stl``.
        cut: The height [m].

    Raises:
        WorldError: The file cannot be read, or the mesh does not reach that height.
    """
    parts = _parts(path)
    if not parts:
        raise WorldError(f"{path}: holds no triangle, so there is no wall")
    pieces = [_cut(part.vertices, part.faces, cut) for part in parts]
    count = np.array([len(segments) for segments, _ in pieces])
    segments = np.concatenate([segments for segments, _ in pieces])
    heights = np.concatenate([heights for _, heights in pieces])
    if not len(segments):
        low = min(float(part.vertices[:, 2].min()) for part in parts)
        high = max(float(part.vertices[:, 2].max()) for part in parts)
        raise WorldError(
            f"{path}: nothing stands at a height of {cut:g} m; the mesh reaches from {low:g} to"
            f" {high:g} m"
        )
    owners = np.repeat(np.arange(len(parts)), count)
    tolerance = FLAT * max(float(np.ptp(segments.reshape(-1, 2), axis=0).max()), 1e-3)
    # Walls of one line and unequal heights stay apart.
    _, first, height = np.unique(
        np.round(heights / tolerance), return_index=True, return_inverse=True
    )
    label = owners * len(first) + height
    segments, label = merge_collinear(segments, label, tolerance=tolerance)
    owners, heights = label // len(first), heights[first][label % len(first)]
    order = np.argsort(owners, kind="stable")
    segments, owners, heights = segments[order], owners[order], heights[order]
    if len(parts) == 1 and not parts[0].name:
        return World(segments, connected(segments), heights, own_name(path))
    numbers, objects = np.unique(owners, return_inverse=True)
    return World(
        segments,
        objects,
        heights,
        own_name(path),
        object_names=tuple(parts[number].name for number in numbers),
        colours=np.array([parts[number].colour for number in numbers]),
        materials=[parts[number].material for number in numbers],
    )


class _Part(NamedTuple):
    """A part of a scene: vertices (n, 3) [m], z up, faces (m, 3), and a colour (3,) or NaN."""

    name: str
    colour: Float
    material: Material | None
    vertices: Float
    faces: Int


def _parts(path: Path) -> list[_Part]:
    """The parts of a scene."""
    import trimesh

    with opened(path, what="a world file", largest=LARGEST_MESH, error=WorldError) as file:
        data = file.read()
    kind = path.suffix.lower()[1:]
    if kind == "gltf":
        # The library would look for another file if this one is missing.
        json.loads(data)
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    scene = trimesh.load_scene(
        BytesIO(data), file_type=kind, resolver=_beside(path), process=False, **options
    )
    turn = (
        np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) if path.suffix.lower() in UPRIGHT_Y else None
    )
    single = len(scene.graph.nodes_geometry) == 1 and kind not in ("glb", "gltf")
    # The graph gives its nodes in any order; the file has its meshes in one.
    order = {key: place for place, key in enumerate(scene.geometry)}
    nodes = [(order[scene.graph[node][1]], str(node), node) for node in scene.graph.nodes_geometry]
    parts = []
    for _, _, node in sorted(nodes, key=lambda item: item[:2]):
        matrix, key = scene.graph[node]
        mesh = scene.geometry[key]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        vertices = trimesh.transform_points(np.asarray(mesh.vertices, dtype=np.float64), matrix)
        vertices = vertices if turn is None else vertices @ turn.T
        faces = np.asarray(mesh.faces, dtype=np.int64)
        used = vertices[np.unique(faces)]
        if not (np.abs(used) <= LARGEST_COORDINATE).all():
            raise WorldError(
                f"{path}: part {str(node)[:40]!r} has a vertex that is not finite, or over"
                f" {LARGEST_COORDINATE:g} m away"
            )
        name = "" if single else str(node)
        parts.append(_Part(name, _colour(mesh), _material(mesh), vertices, faces))
    return parts


def _colour(mesh: Any) -> Float:
    """Red, green, blue (3,) of the material, NaN where it has none."""
    material = getattr(mesh.visual, "material", None)
    factor = getattr(material, "baseColorFactor", None)
    if factor is None:
        return np.full(3, np.nan)
    return np.asarray(factor[:3], dtype=np.float64) / 255.0


def _material(mesh: Any) -> Material | None:
    """The material that lrf3d wrote with a part, or that the name of the part's own is one of."""
    name = getattr(getattr(mesh.visual, "material", None), "name", None)
    return material_of(mesh.metadata.get("material")) or material_of(str(name).lower())


def _cut(vertices: Float, faces: Int, height: float) -> tuple[Float, Float]:
    """Cuts (k, 4) of triangles at a height, and the top (k,) of each triangle [m]."""
    corners = vertices[faces]
    above = corners[..., 2] > height
    met = above.any(axis=1) & ~above.all(axis=1)
    corners, above = corners[met], above[met]
    # One corner is alone on its side of the plane; the two edges from it are cut.
    single = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(corners))
    alone = corners[rows, single]
    ends = []
    for step in (1, 2):
        other = corners[rows, (single + step) % 3]
        share = (height - alone[:, 2]) / (other[:, 2] - alone[:, 2])
        ends.append(alone[:, :2] + share[:, None] * (other[:, :2] - alone[:, :2]))
    segments = np.hstack(ends) if len(corners) else np.empty((0, 4))
    long = lengths(segments) > 0.0
    return segments[long], corners[..., 2].max(axis=1, initial=height)[long]


def _beside(path: Path) -> Any:
    """A resolver for the files that a mesh refers to: only from its folder, with limited size."""
    from trimesh.resolvers import Resolver

    class Beside(Resolver):
        """Files in the folder of a mesh."""

        def __init__(self) -> None:
            """Start with the limit of bytes."""
            self.left = LARGEST_MESH

        def write(self, name: str, data: object) -> None:
            """Nothing is written."""

        def get(self, name: str) -> bytes:
            """The bytes of a file of this name."""
            shown = str(name)[:40]
            if Path(name).name != name or "\\" in name or ":" in name:
                raise WorldError(
                    f"{path}: refers to {shown!r}; only files beside it are read, by name"
                )
            beside = path.parent / name
            if beside.resolve().parent != path.parent.resolve():
                raise WorldError(f"{path}: refers to {shown!r}, a link to elsewhere")
            with opened(beside, what="a world file", largest=self.left, error=WorldError) as file:
                data = file.read()
            self.left -= len(data)
            return data

        def keys(self) -> list[str]:
            """No names are listed."""
            return []

        def namespaced(self, namespace: str) -> "Beside":
            """The same resolver: subfolders are not searched."""
            return self

    return Beside()


def write_glb(world: World, path: Path) -> None:
    """Write a world as GLB.

    Raises:
        OutputError: The file cannot be written.
    """
    with replacing(path) as unfinished:
        unfinished.write_bytes(glb_bytes(world))


def glb_bytes(world: World) -> bytes:
    """The bytes of a binary glTF file of a world."""
    import trimesh

    visual: Any = trimesh.visual
    whole = extrude(world)
    upright = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
    turned = np.asarray(whole.vertices) @ upright[:3, :3].T
    to_source = np.eye(4)
    to_source[:3, 3] = upright[:3, :3] @ [*world.origin, 0.0]
    scene: Any = trimesh.Scene()
    for number in np.unique(world.objects).tolist():
        own = np.flatnonzero(world.objects == number)
        corners = (4 * own[:, None] + np.arange(4)).reshape(-1)
        faces = (
            np.asarray(whole.faces)[:2].reshape(1, 2, 3) + 4 * np.arange(len(own))[:, None, None]
        )
        colour = world.colours[number]
        shade = np.append(colour if np.isfinite(colour).all() else np.full(3, PLAIN), 1.0)
        material = visual.material.PBRMaterial(
            baseColorFactor=shade, metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True
        )
        mesh = trimesh.Trimesh(
            turned[corners],
            faces.reshape(-1, 3),
            process=False,
            visual=visual.TextureVisuals(material=material),
        )
        made_of = world.materials[number] if world.materials else None
        if made_of is not None:
            material.name = made_of.name
            mesh.metadata["material"] = material_value(made_of)
        given = world.object_names[number] if world.object_names else ""
        name = (
            given if given and given not in scene.graph.nodes else f"{given or 'object'} {number}"
        )
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=to_source)
    return bytes(scene.export(file_type="glb"))
