"""The OpenGL renderer: draws what is to be seen with few calls, and reads it back once.

pyrender's own passes sort, light and read back for any scene; for a film with known layers they
cost ten times what the drawing does.
"""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lrf3d.geometry.lines import Float, Int, Single, quad_indices
from lrf3d.studio.render.buffers import (
    GL,
    Buffer,
    CameraBlock,
    ShaderProgram,
    Texture,
    make_current,
)
from lrf3d.studio.render.glsl import columns_of, ground_of, mesh
from lrf3d.studio.render.smooth import smooth_edges
from lrf3d.studio.scene import look
from lrf3d.studio.scene.shapes import (
    Inset,
    Lens,
    Lines,
    Mark,
    Painted,
    Pixels,
    Points,
    Reflection,
    Seen,
    Tints,
    reflections,
)  # fmt: skip
from lrf3d.studio.scene.stage.stage import Stage


class Renderer:
    """Draws the scenes of a stage into pictures of a size [pixels].

    Edges are smooth with 4 samples a pixel, smoothed afterwards with 1, and jagged with 0.
    """

    def __init__(self, stage: Stage, size: tuple[int, int], samples: int) -> None:
        make_current()
        # With samples the picture is drawn larger, and pixels are averaged.
        self._finer = max(1, samples // 2)
        self._size = self._finer * size[0], self._finer * size[1]
        self._setting = stage.structures.setting
        self._buffers: dict[str, Buffer] = {}
        self._frame, self._targets = _framebuffer(self._size)
        self._smooths = samples == 1
        self._programs: dict[str, ShaderProgram] = {}
        self._limit = 0, 0, *self._size
        self._scale = self._finer * look.scale(size, look.LEAST_SCALE)
        self._camera = CameraBlock()
        self._parts = _Parts(stage.faces)
        self._chosen = np.zeros(0, np.int64)
        self._walls = self._filled("walls", *stage.faces[:4])
        ground = stage.ground
        self._ground = self._filled("ground", ground_of(ground, 1))
        self._area = (*ground.corner.tolist(), *(1.0 / ground.size).tolist())
        self._sky = self._filled("sky", mesh(*[np.linspace(-1.0, 1.0, 11)] * 2))
        self._pavement = Texture(0, ground.picture)
        exposure = stage.exposure
        self._mirrors = stage.mirrors
        self._times, self._tints = (
            Texture(unit, texels)
            for unit, texels in ((2, exposure.texels), (3, np.zeros_like(exposure.texels)))
        )
        # The colours of the map on the same cells are drawn.
        self._tinting = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._tinting)
        GL.glFramebufferTexture2D(
            GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, GL.GL_TEXTURE_2D, self._tints.id, 0
        )
        self._tinted: Tints | None = None
        # What shaders that know of the laser's light read it with.
        self._light: dict[str, Any] = {
            "grid": exposure.area, "times": self._times.unit, "tints": self._tints.unit,
        }  # fmt: skip

    def draw(self, seen: Seen) -> Pixels:
        """The picture (h, w, 3) uint8 of what is to be seen."""
        make_current()
        self._light |= {"clock": seen.clock, "dusk": seen.dusk}
        self._draw_tints(seen.tints)
        self._limit = 0, 0, self._finer * seen.columns or self._size[0], self._size[1]
        # The sky covers what nothing else does, so that only the depth needs clearing.
        self._begin(GL.GL_DEPTH_BUFFER_BIT)
        for reflection in reflections(seen, self._mirrors):
            self._reflect(seen, reflection)
        self._camera.fill(seen.lens, *self._size)
        self._draw_bodies(seen)
        self._draw_walls(seen, seen.lens, "")
        self._draw_ground("ground")
        self._draw_sky(seen.lens)
        for name, mark in seen.marks:
            self._draw_mark(name, mark, self._finer * seen.lens.focus)
        return self._read()

    def plan(self, plan: Inset, size: tuple[int, int]) -> Pixels:
        """The picture (h, w, 3) uint8 of a map, of a size [pixels] that is in the other's."""
        make_current()
        self._light["clock"] = plan.clock
        self._limit = 0, 0, self._finer * size[0], self._finer * size[1]
        GL.glClearColor(*(part / look.WHITE for part in look.PLAN_BACK), 1.0)
        self._begin(GL.GL_COLOR_BUFFER_BIT)
        GL.glDisable(GL.GL_DEPTH_TEST)
        GL.glViewport(*self._limit)
        self._camera.fill(plan.lens, *self._limit[2:])
        self._draw_ground("ground:PLAN", blend=True, solid=False)
        for name, mark in plan.marks:
            self._draw_mark(name, mark, self._finer * plan.lens.focus)
        return self._read()

    def close(self) -> None:
        """Free what the driver holds; the context stays."""
        # The names are of this context: in a viewer's, they are those of other things.
        make_current()
        for program in self._programs.values():
            program.delete()
        for buffer in self._buffers.values():
            buffer.delete()
        for texture in (self._pavement, self._times, self._tints):
            texture.delete()
        self._camera.delete()
        GL.glDeleteFramebuffers(2, [self._frame, self._tinting])
        GL.glDeleteRenderbuffers(len(self._targets), self._targets)

    def _read(self) -> Pixels:
        """What is drawn within the limit (h, w, 3), with smooth edges."""
        size = self._limit[2:]
        drawn = np.empty(size[::-1], np.uint32)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        place = ctypes.c_void_p(drawn.ctypes.data)
        GL.glReadPixels(*self._limit, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, place)
        if self._smooths:
            picture = np.empty((*size[::-1], 3), np.uint8)
            bright, contrast = np.empty((2, *size[::-1]), np.int16)
            smooth_edges(drawn, bright, contrast, picture)
            return picture
        # Pillow leaves out the fourth byte of pixels in a sixth of NumPy's time.
        whole = Image.frombuffer("RGBX", size, drawn, "raw", "RGBX", 0, 1)
        return np.array(whole.reduce(self._finer).convert("RGB"))

    def _begin(self, cleared: int) -> None:
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glViewport(0, 0, *self._size)
        GL.glDepthMask(GL.GL_TRUE)
        # Clearing all takes a fraction of the time of clearing a part.
        GL.glDisable(GL.GL_SCISSOR_TEST)
        GL.glClear(cleared)
        GL.glEnable(GL.GL_SCISSOR_TEST)
        GL.glScissor(*self._limit)
        self._times.bind()
        self._tints.bind()
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthFunc(GL.GL_LEQUAL)
        # Blending lowers the opacity of the picture, by which soft edges are not smoothed again.
        left = GL.GL_ZERO, GL.GL_ONE_MINUS_SRC_ALPHA
        GL.glBlendFuncSeparate(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA, *left)
        GL.glEnable(GL.GL_PROGRAM_POINT_SIZE)
        # The picture is drawn turned over, which turns the sense of its triangles too.
        GL.glFrontFace(GL.GL_CW)

    def _filled(
        self, name: str, *columns: Single, mode: int = GL.GL_TRIANGLES, corners: int = 1
    ) -> Buffer:
        buffer = self._buffers.get(name) or self._buffers.setdefault(name, Buffer(mode))
        buffer.fill(columns, corners=corners)
        return buffer

    def _paint(
        self,
        program: str,
        buffer: Buffer,
        *,
        blend: bool = False,
        cull: bool = False,
        solid: bool = True,
        **uniforms: Any,
    ) -> None:
        if not buffer.count:
            return
        for what, on in ((GL.GL_BLEND, blend), (GL.GL_CULL_FACE, cull)):
            (GL.glEnable if on else GL.glDisable)(what)
        GL.glDepthMask(solid)
        if program not in self._programs:
            self._programs[program] = ShaderProgram(program, self._setting)
        self._programs[program].use(uniforms)
        buffer.draw()

    def _draw_tints(self, tints: Tints | None) -> None:
        if tints is self._tinted:
            return
        self._tinted = tints
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._tinting)
        GL.glViewport(0, 0, *self._tints.size)
        GL.glClearColor(0.0, 0.0, 0.0, 0.0)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT)
        if tints is not None:
            GL.glDisable(GL.GL_DEPTH_TEST)
            GL.glDisable(GL.GL_SCISSOR_TEST)
            self._camera.fill(tints.lens, *self._tints.size)
            # How much of a cell is covered adds up to its opacity.
            one = GL.GL_ONE, GL.GL_ONE_MINUS_SRC_ALPHA
            GL.glBlendFuncSeparate(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA, *one)
            buffer = self._filled("tints", *columns_of(tints.lines).values(), corners=4)
            self._paint("lines", buffer, blend=True, solid=False, width=(tints.lines.width, 0.0))

    def _reflect(self, seen: Seen, reflection: Reflection) -> None:
        self._camera.fill(reflection.lens, *self._size)
        GL.glFrontFace(GL.GL_CCW)
        self._draw_bodies(seen, ":MIRRORED", **reflection.uniforms)
        self._draw_walls(seen, reflection.lens, ":MIRRORED", **reflection.uniforms)
        self._draw_ground("ground:MIRRORED", **reflection.uniforms)
        # The mirror's rectangle keeps the room's own sky out.
        self._draw_sky(reflection.lens)
        GL.glFrontFace(GL.GL_CW)
        self._camera.fill(seen.lens, *self._size)
        GL.glColorMask(False, False, False, False)
        GL.glDepthFunc(GL.GL_ALWAYS)
        self._paint("faces", self._filled("seal", reflection.seal, reflection.seal), pose=np.eye(4))
        GL.glDepthFunc(GL.GL_LEQUAL)
        GL.glColorMask(True, True, True, True)

    def _draw_bodies(self, seen: Seen, defined: str = "", **uniforms: Any) -> None:
        for name, body in seen.bodies:
            self._paint(
                f"faces{defined}",
                self._filled(name, *body.faces),
                cull=True,
                pose=body.pose,
                **uniforms,
            )

    def _draw_sky(self, lens: Lens) -> None:
        self._paint("sky", self._sky, ray_from_corner=np.linalg.inv(lens.matrix))

    def _draw_ground(self, program: str, **how: Any) -> None:
        self._pavement.bind()
        self._paint(program, self._ground, area=self._area, **self._light, **how)

    def _draw_walls(self, seen: Seen, lens: Lens, variant: str, **uniforms: Any) -> None:
        parts = self._parts.seen(lens.matrix, lens.eye)
        if not np.array_equal(parts, self._chosen):
            self._chosen = parts
            self._walls.choose(self._parts.choose(parts))
        self._paint(
            f"walls{variant}", self._walls, cull=True, cut=seen.cut, **self._light, **uniforms
        )

    def _draw_mark(self, name: str, mark: Mark, focus: float) -> None:
        mode = GL.GL_POINTS if isinstance(mark, Points) else GL.GL_TRIANGLES
        corners = 4 if isinstance(mark, Lines) else 1
        buffer = self._filled(name, *columns_of(mark).values(), mode=mode, corners=corners)
        if isinstance(mark, Points):
            sizes = (mark.size * focus, *(self._scale * size for size in mark.pixels))
            program = "points:GLOW_ROUND" if mark.glows else "points"
            self._paint(program, buffer, blend=True, solid=False, sizes=sizes)
        elif isinstance(mark, Lines):
            width = mark.width * self._scale, mark.thick * focus
            self._paint("lines", buffer, blend=True, solid=False, width=width)
        else:
            GL.glDepthFunc(GL.GL_ALWAYS if mark.on_top else GL.GL_LEQUAL)
            self._paint("soft", buffer, blend=True, solid=False)
            GL.glDepthFunc(GL.GL_LEQUAL)


class _Parts:
    """The quads of walls and roofs by their objects, of which near ones are drawn first.

    Farther pixels then fail their depth test and are not painted.
    """

    def __init__(self, faces: Painted) -> None:
        owners = faces.objects
        self.count = int(faces.objects.max(initial=-1)) + 1
        self._quads = quad_indices(len(owners)).reshape(-1, 6)[np.argsort(owners, kind="stable")]
        self._sizes = np.bincount(owners, minlength=self.count)
        self._starts = np.cumsum(self._sizes) - self._sizes
        self._low, self._high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        np.minimum.at(self._low, owners, faces.places.min(axis=1))
        np.maximum.at(self._high, owners, faces.places.max(axis=1))

    def seen(self, matrix: Float, eye: Float) -> Int:
        """Parts that a picture of a matrix (4, 4) from an eye (3,) may show, near ones first."""
        inside = self._sizes > 0
        x, y, _, w = matrix
        for plane in (w, w + x, w - x, w + y, w - y):
            # The corner that lies farthest on the inner side of the plane.
            corner = np.where(plane[:3] > 0.0, self._high, self._low)[inside]
            inside[inside] = corner @ plane[:3] + plane[3] > 0.0
        parts = np.flatnonzero(inside)
        gap = np.maximum(self._low[parts, :2] - eye[:2], eye[:2] - self._high[parts, :2])
        gap = np.maximum(gap, 0.0)
        return parts[np.argsort(np.hypot(gap[:, 0], gap[:, 1]), kind="stable")]

    def choose(self, parts: Int) -> NDArray[np.uint32]:
        """Vertices of parts in their order."""
        sizes = self._sizes[parts]
        before = np.cumsum(sizes) - sizes
        chosen = np.repeat(self._starts[parts] - before, sizes) + np.arange(int(sizes.sum()))
        return self._quads[chosen].ravel()


def _framebuffer(size: tuple[int, int]) -> tuple[int, list[int]]:
    """A framebuffer, and the buffers of its colour and its depth."""
    frame = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, frame)
    made = GL.glGenRenderbuffers(2).tolist()
    for each, kind, place in zip(
        made,
        (GL.GL_RGBA8, GL.GL_DEPTH_COMPONENT24),
        (GL.GL_COLOR_ATTACHMENT0, GL.GL_DEPTH_ATTACHMENT),
        strict=True,
    ):
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, each)
        GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, *size)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, each)
    return frame, made
