"""Worlds of Gazebo in SDF (``.sdf``, ``.world``): shapes that stand become walls with heights.

Solids, polylines and meshes of collisions, or of visuals where a link has none,
are cut at the height of the beams, or at half their height if they are lower; each shape is an
object with the name of its model. Models of ``include`` and meshes are searched by their names in
the folder of the file, in those above it, and in ``models`` beside it; nothing is fetched. Models
with sensors are robots, which are left out. Shapes that are not used are counted by reason.
"""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from lrf3d.base.balance import Balance
from lrf3d.base.errors import InputError, WorldError, one_line
from lrf3d.base.files import own_name
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, number
from lrf3d.world.mesh import CUT, joined, level_cut, load_scene, tops_of
from lrf3d.world.model import World
from lrf3d.world.pieces import Part, world_of_parts

# Models that may be included within each other.
DEEPEST = 16

# Sides of cylinders and spheres: with 48 a circle of 1 m is 2 mm off.
SIDES = 48

# Sizes of round shapes with an axis, and how many numbers each is.
ROUND = {"radius": 1, "length": 1}

# Solids: their sizes, and the mesh that trimesh.creation makes of them, around its middle.
SOLIDS: dict[str, tuple[dict[str, int], Callable[..., Any]]] = {
    "box": ({"size": 3}, lambda make, size: make.box(size)),
    "cylinder": (ROUND, lambda make, r, length: make.cylinder(r[0], length[0], sections=SIDES)),
    "capsule": (ROUND, lambda make, r, length: make.capsule(length[0], r[0], [SIDES, SIDES])),
    "cone": (
        ROUND,
        lambda make, r, length: make.cone(r[0], length[0], sections=SIDES).apply_translation(
            [0.0, 0.0, -0.5 * length[0]]
        ),
    ),
    "sphere": ({"radius": 1}, lambda make, r: make.uv_sphere(r[0], [SIDES, SIDES])),
    "ellipsoid": (
        {"radii": 3},
        lambda make, radii: make.uv_sphere(1.0, [SIDES, SIDES]).apply_scale(radii),
    ),
}

# Models of Gazebo that have no walls.
WITHOUT_WALLS = ("sun", "ground plane")

# Elements that other poses may be relative to.
FRAMES = ("frame", "include", "joint", "link", "model")

# Folders above a file in which models are searched.
FOLDERS_ABOVE = 3

# Rounding of lengths [m], within which walls go straight on.
TOLERANCE = 1e-6


def read_sdf(path: Path, cut: float | None = None) -> World:
    """Read the shapes of a world, cut at a height [m], as walls."""
    height = CUT if cut is None else number(cut, "cut", positive=True)
    reading = _SdfWalls(path, height)
    root = _root(path)
    for scope in (root, *root.findall("world")):
        reading.add_models(scope, np.eye(4), path, 0)
    balance = reading.balance
    if not reading.parts:
        raise WorldError(
            f"no shape stands {height:g} m high; left out: {balance.words() or 'none'}"
        )
    balance.note(path)
    return world_of_parts(reading.parts, own_name(path))


def _element(path: Path) -> Element:
    """The element of a file, which may be no XML, but what Gazebo reads: with -- in comments."""
    plain = re.sub(rb"<!--.*?-->", b"", path.read_bytes(), flags=re.DOTALL)
    return ElementTree.fromstring(re.sub(rb"&(?![#\w]+;)", b"&amp;", plain))


def _root(path: Path) -> Element:
    root = _element(path)
    if root.tag != "sdf":
        raise WorldError(f"its root is <{one_line(root.tag, 40)}>, expected <sdf>")
    return root


@dataclass
class _SdfWalls:
    """The walls of a file that is read, each shape an object, and the balance of its shapes."""

    path: Path
    cut: float
    parts: list[Part] = field(default_factory=list)
    balance: Balance = field(default_factory=lambda: Balance("shape"))

    def add_models(self, scope: Element, pose: Float, file: Path, depth: int) -> None:
        """Add the models and includes of a world or of a model at a pose (4, 4)."""
        if depth > DEEPEST:
            raise WorldError(f"{file.name}: models within each other more than {DEEPEST} times")
        for model in scope.findall("model"):
            own = _moved(model, model.get("name"), scope)
            self._add_model(model, pose @ _pose(own, scope), file, depth)
        for include in scope.findall("include"):
            uri = include.findtext("uri", "").strip()
            found = self._find(uri, file)
            sdf = None if found is None else _file_of_model(found)
            if sdf is None:
                name = one_line(_name(uri), 60)
                plain = name.lower().replace("_", " ") in WITHOUT_WALLS
                self.balance.all += 1
                self.balance.leave("sun or ground plane" if plain else f"missing model: {name}")
                continue
            try:
                models = _root(sdf).findall("model")
            except (ElementTree.ParseError, WorldError):
                self.balance.all += 1
                self.balance.leave(f"unreadable model: {one_line(_name(uri), 60)}")
                continue
            for model in models:
                own = include if include.find("pose") is not None else model
                own = _moved(own, include.findtext("name", model.get("name")), scope)
                self._add_model(model, pose @ _pose(own, scope, model), sdf, depth + 1)

    def _add_model(self, model: Element, pose: Float, file: Path, depth: int) -> None:
        name = model.get("name", "")
        shapes = [shape for link in model.findall("link") for shape in _shapes(link)]
        self.balance.all += len(shapes)
        if model.find("link/sensor") is not None:
            self.balance.leave(f"shape of robots: {one_line(name, 60)}", len(shapes))
            return
        # Shapes may name frames of the model.
        names = {"__model__", *(each.get("name") for each in model if each.tag in FRAMES)}
        for link in model.findall("link"):
            own = pose @ _pose(link, model)
            for shape in _shapes(link):
                named = names & {_relative_to(shape).partition("::")[0]}
                place = pose @ _pose(shape, model) if named else own @ _pose(shape, link)
                self._add_shape(shape, place, name, file)
        self.add_models(model, pose, file, depth + 1)

    def _add_shape(self, shape: Element, pose: Float, name: str, file: Path) -> None:
        kind = shape.find("geometry/*")
        reason = "shape of no kind"
        mesh = None
        if kind is not None:
            reason = f"unread {one_line(kind.tag, 30)}"
            mesh = self._mesh(kind, file)
        if isinstance(mesh, str):
            reason = mesh
        elif mesh is not None:
            triangles = np.asarray(mesh.vertices @ pose[:3, :3].T + pose[:3, 3])[mesh.faces]
            reason = self._add_walls(triangles, name)
        if reason:
            self.balance.leave(reason)
        else:
            self.balance.used += 1

    def _add_walls(self, triangles: Float, name: str) -> str:
        """Add the cut of triangles (n, 3, 3); why there is none, if so."""
        if not len(triangles):
            return "mesh without triangles"
        if not (np.abs(triangles) <= LARGEST_COORDINATE).all():
            return "shape of a place too far away"
        low = float(triangles[..., 2].min())
        high = float(triangles[..., 2].max())
        if low >= self.cut:
            return "shape of greater height"
        if high <= TOLERANCE:
            return "shape of no height"
        # Exactly the height of corners would cut nothing.
        height = self.cut if high > self.cut else 0.5 * (max(low, 0.0) + high)
        segments, face = level_cut(triangles, height)
        tops = np.round(tops_of(triangles, segments, face, height), 6)
        for top in np.unique(tops).tolist():
            walls = joined(segments[tops == top], TOLERANCE)
            self.parts.append(Part(self.balance.used, walls, np.array(top), name))
        return "" if len(segments) else "shape of no walls"

    def _mesh(self, kind: Element, file: Path) -> Any:
        """The mesh of a shape, z up; None if its kind is not read, or why it is left out."""
        import trimesh

        if kind.tag in SOLIDS:
            sizes, make = SOLIDS[kind.tag]
            values = {name: _numbers(kind.findtext(name, ""), sizes[name]) for name in sizes}
            return make(trimesh.creation, *values.values())
        if kind.tag == "polyline":
            low = np.array([[*_numbers(at.text or "", 2), 0.0] for at in kind.findall("point")])
            high = low + np.array([0.0, 0.0, _numbers(kind.findtext("height", ""), 1)[0]])
            corners = [low, high, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)]
            # The sides are enough, since they are what is cut.
            sides = np.concatenate([np.stack(corners[:3], 1), np.stack(corners[1:], 1)])
            faces = np.arange(3 * len(sides)).reshape(-1, 3)
            return trimesh.Trimesh(sides.reshape(-1, 3), faces)
        if kind.tag == "plane":
            return "ground plane"
        # For a part of a mesh the whole is read, unless the part stands elsewhere.
        if kind.findtext("submesh/center", "").strip() in ("true", "1"):
            return "part of a centred mesh"
        return self._loaded(kind, file) if kind.tag == "mesh" else None

    def _loaded(self, kind: Element, file: Path) -> Any:
        """The mesh of a file, or why it is left out."""
        import trimesh

        uri = kind.findtext("uri", "").strip()
        found = self._find(uri, file)
        if found is None or not found.is_file():
            return f"missing mesh file: {one_line(_name(uri), 60)}"
        try:
            scene = load_scene(found, skip_materials=True)
            mesh = scene.to_mesh()
            # Files of COLLADA name their unit, which is often an inch.
            unit = trimesh.units.unit_conversion(scene.units, "meters") if scene.units else 1.0
        except ImportError:
            return f"mesh file of COLLADA, which 'lrf3d[sdf]' reads: {found.name}"
        except Exception as error:
            # Libraries of meshes raise what they like.
            return f"unreadable mesh file: {found.name} ({one_line(str(error), 60)})"
        scale = _numbers(kind.findtext("scale", "1 1 1"), 3)
        mesh.vertices = mesh.vertices * (unit * np.array(scale))
        return mesh

    def _find(self, uri: str, file: Path) -> Path | None:
        """The file or the folder that a URI names, near the file that names it."""
        name = _name(uri)
        if not name:
            return None
        above = [*file.resolve().parents, *self.path.resolve().parents[:FOLDERS_ABOVE]]
        folders = [*above[: FOLDERS_ABOVE + 1], *self.path.resolve().parents[:FOLDERS_ABOVE]]
        places = (folder / each / name for folder in folders for each in ("", "models"))
        return next((place for place in places if place.exists()), None)


def _name(uri: str) -> str:
    """The name of a model, and the path in it, that a URI gives: the last of a model on the web."""
    scheme, colon, rest = uri.partition("://")
    if not colon:
        return uri
    if not scheme.startswith("http"):
        return rest
    # The last number is the version of a model.
    return re.sub(r"/\d+$", "", rest.rstrip("/").rpartition("/models/")[2])


def _file_of_model(place: Path) -> Path | None:
    """The SDF of a model's folder, which its model.config names, or of a file."""
    if place.is_file():
        return place
    named = ""
    with suppress(OSError, ElementTree.ParseError):
        named = _element(place / "model.config").findtext("sdf", "").strip()
    found = (place / each for each in (named, "model.sdf") if each)
    return next((each for each in found if each.is_file()), None)


def _shapes(link: Element) -> list[Element]:
    """The shapes of a link that beams meet: its collisions, or else its visuals."""
    return link.findall("collision") or link.findall("visual")


def _moved(element: Element, name: str | None, scope: Element) -> Element:
    """A model, or the state that says where it was moved to, as Gazebo Classic saves it."""
    states = scope.iterfind("state/model[pose]")
    return next((each for each in states if each.get("name") == name), element)


def _relative_to(element: Element) -> str:
    """The name of the frame to which the pose of an element is relative."""
    given = element.find("pose")
    return "" if given is None else given.get("relative_to", "").strip()


def _pose(element: Element, scope: Element, model: Element | None = None) -> Float:
    """The pose (4, 4) of an element, which may include a model, in what holds it.

    Raises RecursionError if it is relative to itself.
    """
    given = element.find("pose")
    pose = np.eye(4) if given is None else _given_pose(given)
    # Without a name, a frame is relative to what it is attached to, and a joint to its child.
    attached_to = element.get("attached_to", "") or element.findtext("child", "")
    pose = _frame(_relative_to(element) or attached_to.strip(), scope) @ pose
    # The pose of a model may be that of one of its frames.
    placed = element.get("placement_frame", "") or element.findtext("placement_frame", "")
    if placed:
        pose = pose @ np.linalg.inv(_frame(placed.strip(), element if model is None else model))
    return np.asarray(pose)


def _frame(name: str, scope: Element) -> Float:
    """The pose (4, 4) of a named frame, as ``link`` or ``model::link``, in what holds it."""
    first, _, rest = name.partition("::")
    for each in scope if first else ():
        if each.tag in FRAMES and first in (each.get("name"), each.findtext("name")):
            return np.asarray(_pose(each, scope) @ _frame(rest, each))
    # No name, __model__ and world mean what holds it.
    return np.eye(4)


def _given_pose(given: Element) -> Float:
    """The pose (4, 4) of numbers in a file."""
    matrix = np.eye(4)
    text = given.text or ""
    if not text.split():
        return matrix
    if given.get("rotation_format") == "quat_xyzw":
        row = _numbers(text, 7)
        turn = Rotation.from_quat(row[3:])
    else:
        row = _numbers(text, 6)
        turn = Rotation.from_euler("xyz", row[3:], degrees=given.get("degrees") == "true")
    matrix[:3, :3] = turn.as_matrix()
    matrix[:3, 3] = row[:3]
    return matrix


def _numbers(text: str, count: int) -> list[float]:
    """Finite numbers of a text; raises InputError if there are others, or not as many."""
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) != count or not np.isfinite(found).all():
        raise InputError(f"{one_line(text, 60) or 'an empty text'!r}: expected {count} numbers")
    return found
