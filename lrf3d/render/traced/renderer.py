"""TracedRenderer: draws the same scenes as the OpenGL renderer, with the same calls, on the CPU.

Embree finds what each pixel sees of walls and roofs; ground and sky follow from the ray. What
moves is drawn over it as triangles, points and panels, tested against the depth of that. Pixels
at edges get four rays more, so that edges are as smooth as a graphics card's.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Float
from lrf3d.render.parts import PartedPrimitive
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import Primitive
from lrf3d.render.traced import raster, sampling, shading
from lrf3d.render.traced.programs import corners_of, points_of
from lrf3d.render.traced.surfaces import Grounds, Surfaces
from lrf3d.scene.look import PAPER, SUN

Box = tuple[int, int, int, int]
Uniforms = Mapping[str, Any]


class TracedRenderer:
    """Draws scenes of :class:`Primitive` into RGBA pictures without OpenGL.

    Args:
        width: Width of the pictures [pixels].
        height: Height [pixels].
        samples: Samples a pixel against jagged edges: 4, or 0 for none.
    """

    def __init__(self, width: int, height: int, samples: int) -> None:
        self._whole: Box = (0, 0, width, height)
        self._places = sampling.SAMPLE_PLACES if samples else sampling.MIDDLE
        count = len(self._places)
        self._sampled = np.zeros((height, width, count, 3), np.uint8)
        self._sampled_near = np.zeros((height, width, count), np.float32)
        # With one sample a pixel, both are the same.
        self._flat = self._sampled if count == 1 else np.zeros((height, width, 1, 3), np.uint8)
        self._flat_near = (
            self._sampled_near if count == 1 else np.zeros((height, width, 1), np.float32)
        )
        self._seen = np.zeros((height, width), np.int32)
        self._rays = np.empty((2, height * width, 3), np.float32)
        self._picture: Picture = np.full((height, width, 4), 255, np.uint8)
        self._surfaces: Surfaces | None = None
        self._grounds = Grounds()
        self._solids: list[tuple[Primitive, Uniforms]] = []
        self._constants: Uniforms = {}
        self._camera: Uniforms = {}
        self._covers: list[Box] = []
        self._box, self._over = self._whole, False

    def know(self, constants: Uniforms) -> None:
        """Be told what is the same in all pictures, before the first."""
        self._constants = constants

    def begin(self, scene: Any) -> None:
        """Start a picture."""
        self._box, self._over = self._whole, False
        self._solids, self._covers = [], []

    def camera_matrices(self, scene: Any) -> tuple[Float, Float]:
        """Matrix (4, 4) from the scene to the picture turned over, and the eye (3,)."""
        node = scene.main_camera_node
        pose = np.asarray(scene.get_pose(node))
        width, height = self._whole[2:]
        projection = np.array(node.camera.get_projection_matrix(width=width, height=height))
        projection[1] *= -1.0
        return projection @ np.linalg.inv(pose), pose[:3, 3]

    def look_through(self, camera: Uniforms) -> None:
        """Draw what comes as a camera sees it."""
        self._camera = camera

    def draw(self, primitive: Primitive, uniforms: Uniforms) -> None:
        """Draw a primitive with uniforms for its program; what is solid waits for the rays."""
        name = primitive.program
        uniforms = {**self._camera, **uniforms}
        if name == "walls" and self._surfaces is None:
            assert isinstance(primitive, PartedPrimitive) and primitive.texture is not None
            corners = primitive.vertices[primitive.triangles.ravel()].reshape(-1, 3, 16)
            self._surfaces = Surfaces(corners, primitive.texture.levels)
        if not primitive.count:
            return
        if name == "ground":
            self._grounds.add(primitive, uniforms)
        elif name == "robot" or (name == "bands" and not primitive.blend):
            self._solids.append((primitive, uniforms))
        elif name == "cover":
            self._covers.append(self._pixels(uniforms["box"]))
        elif name == "label":
            self._draw_label(primitive, uniforms)
        elif name == "points":
            points = points_of(_vertices(primitive), uniforms, self._box)
            raster.draw_points(points, self._box, not self._over, self._flat, self._flat_near)
        elif name not in ("walls", "sky", "beyond"):
            middle = sampling.MIDDLE
            self._draw_triangles(primitive, uniforms, middle, self._flat, self._flat_near)

    def flatten(self) -> None:
        """Draw what is solid, and go on with one sample a pixel."""
        self._trace()
        for solid, uniforms in self._solids:
            self._draw_triangles(solid, uniforms, self._places, self._sampled, self._sampled_near)
        if len(self._places) > 1:
            sampling.resolve(self._sampled, self._sampled_near, self._flat, self._flat_near)
        for left, top, right, bottom in self._covers:
            self._flat[top:bottom, left:right] = np.round(255.0 * np.array(PAPER))
            self._flat_near[top:bottom, left:right] = np.inf

    def overlay(self, box: Box | None) -> None:
        """Go on without depth, in a box left, top, width, height [pixels] or in the whole."""
        self._over = True
        self._box = self._whole if box is None else box

    def finish(self) -> Picture:
        """The picture (h, w, 4) uint8; it is written over by the next one."""
        self._picture[:, :, :3] = self._flat[:, :, 0]
        return self._picture

    def delete(self) -> None:
        """Free what is large."""
        self._surfaces = None

    def _trace(self) -> None:
        """Find and shade what all pixels see, and look through the samples of those at edges."""
        assert self._surfaces is not None
        surfaces, places, width = self._surfaces, self._places, self._whole[2]
        camera = _camera(self._camera, self._whole)
        scenery = shading.RayScene(
            surfaces.faces,
            surfaces.painted,
            surfaces.painted_levels,
            *self._grounds.table(),
            np.array([self._constants["BARE"], *self._constants["PAINTS"]]),
            _light(self._constants, self._camera),
        )
        origins, directions = self._rays
        shading.aim_pixels(camera, width, origins, directions)
        hits = surfaces.nearest(origins, directions)
        shading.shade_pixels(camera, hits, scenery, self._sampled, self._sampled_near, self._seen)
        if len(places) == 1:
            return
        edges = sampling.find_edges(self._seen, surfaces.faces)
        origins, directions = np.empty((2, len(edges) * len(places), 3), np.float32)
        sampling.aim_samples(camera, edges, width, places, origins, directions)
        hits = surfaces.nearest(origins, directions)
        sampling.shade_samples(
            camera, edges, places, hits, scenery, self._sampled, self._sampled_near
        )

    def _draw_triangles(
        self,
        primitive: Primitive,
        uniforms: Uniforms,
        places: Float,
        colours: NDArray[np.uint8],
        near: NDArray[np.float32],
    ) -> None:
        drawn = corners_of(primitive.program, _vertices(primitive), uniforms)
        test = not self._over
        canvas = raster.RasterTarget(
            colours, near, self._box, places, test, test and not primitive.blend
        )
        program = raster.FragmentProgram(
            drawn.program,
            drawn.fixed,
            np.array(uniforms["eye"]),
            _light(self._constants, uniforms),
        )
        raster.draw_triangles(drawn.corners, primitive.cull, canvas, program)

    def _draw_label(self, primitive: Primitive, uniforms: Uniforms) -> None:
        column, row = self._pixels(uniforms["box"])[:2]
        assert primitive.texture is not None
        raster.draw_panel(primitive.texture.picture, column, row, self._flat)

    def _pixels(self, box: tuple[float, ...]) -> Box:
        """Left, top, right and bottom [pixels] of a box in −1…1."""
        width, height = self._box[2:]
        left, top, right, bottom = (0.5 + 0.5 * at for at in box)
        return (
            round(left * width), round(top * height), round(right * width), round(bottom * height)
        )  # fmt: skip


def _vertices(primitive: Primitive) -> Float:
    """The vertices (n, values) of what a primitive draws, three for each triangle."""
    rows = primitive.vertices
    if primitive.elements is not None:
        rows = rows[primitive.elements]
    return rows[: primitive.count].astype(np.float64)


def _camera(uniforms: Uniforms, box: Box) -> Float:
    """The camera's row of :mod:`shading`, for a picture as large as the box."""
    matrix, eye = np.asarray(uniforms["view_projection"]), np.asarray(uniforms["eye"])
    inverse = np.linalg.inv(matrix)

    def ray(x: float, y: float) -> Float:
        far = inverse @ np.array([x, y, 1.0, 1.0])
        way = far[:3] / far[3] - eye
        return np.asarray(way / (matrix[3, :3] @ way))

    corner = ray(-1.0, -1.0)
    across = (ray(1.0, -1.0) - corner) / box[2]
    down = (ray(-1.0, 1.0) - corner) / box[3]
    return np.concatenate([eye, corner, across, down])


def _light(constants: Uniforms, camera: Uniforms) -> Float:
    """The light's row of :mod:`shading`."""
    air = [*constants["HAZE"], camera["thick"], constants["INDOOR"]]
    return np.array([*SUN, *air, *constants["BEYOND"]])
