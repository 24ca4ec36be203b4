"""The lean renderer: pyrender's scenes, drawn with few calls and read back once, right side up."""

import ctypes
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import Float
from lrf3d.render.bindings import GL, pyrender
from lrf3d.render.gl import INSTALL_LINE
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import Primitive
from lrf3d.render.programs import CameraBlock, ShaderProgram, Uniform


@cache
def context() -> Any:
    """The one OpenGL context of this process, current in the thread that asks first.

    It is pyrender's, and stays: deleting one of them would end every other in the process.

    Raises:
        MissingLibraryError: The libraries are there, but no driver that they could start.
    """
    try:
        return pyrender.OffscreenRenderer(16, 16)
    except Exception as error:
        # pyrender asserts what EGL answers, so that any failure may come as anything.
        raise MissingLibraryError(
            f"OpenGL cannot start ({error!r}); install its software driver: {INSTALL_LINE}"
        ) from error


class Renderer(pyrender.Renderer):  # type: ignore[misc]
    """Draws scenes of :class:`Primitive` into RGBA pictures.

    pyrender's own passes sort, light and read back for any scene; for a film with known layers
    they cost ten times what the drawing does.

    Args:
        width: Width of the pictures [pixels].
        height: Height [pixels].
        samples: Samples a pixel against jagged edges: 4, or 0 for none.
    """

    def __init__(self, width: int, height: int, samples: int) -> None:
        self._context = context()
        self._context._platform.make_current()
        super().__init__(width, height)
        self._samples = samples
        self._meshes: set[Any] = set()
        self._scene: Any = None
        self._main_fb: int | None = None
        self._main_fb_ms: int | None = None
        self._buffers: list[int] = []
        self._samples_taken: list[int] = []
        self._constants: Mapping[str, Any] = {}
        self._programs: dict[str, ShaderProgram] = {}
        self._camera: CameraBlock | None = None
        self._picture: Picture = np.zeros((height, width, 4), np.uint8)

    def know(self, constants: Mapping[str, Any]) -> None:
        """Make the programs with these constants, which shaders know by name."""
        self._constants = constants

    def begin(self, scene: Any) -> None:
        """Start a picture: free what has left the scene, clear and set up."""
        self._context._platform.make_current()
        self._free_all_but(scene.meshes)
        self._scene = scene
        self._configure_main_framebuffer()
        target = self._main_fb_ms if self._samples else self._main_fb
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, target)
        GL.glViewport(0, 0, self.viewport_width, self.viewport_height)
        GL.glDepthMask(GL.GL_TRUE)
        # The sky covers what nothing else does, so that only the depth needs clearing.
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthFunc(GL.GL_LEQUAL)
        GL.glBlendFunc(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
        GL.glEnable(GL.GL_PROGRAM_POINT_SIZE)
        # Turning the picture over turns the sense of its triangles too.
        GL.glFrontFace(GL.GL_CW)

    def camera_matrices(self, scene: Any) -> tuple[Float, Float]:
        """Matrix (4, 4) from the scene to the picture turned over, and the eye (3,)."""
        view, projection = self._get_camera_matrices(scene)
        # Row 0 of what OpenGL gives back is the lowest; so the picture is drawn upside down.
        projection = projection.copy()
        projection[1] *= -1.0
        return projection @ view, scene.get_pose(scene.main_camera_node)[:3, 3]

    def look_through(self, camera: Mapping[str, Any]) -> None:
        """Draw what comes as a camera sees it."""
        if self._camera is None:
            self._camera = CameraBlock()
        self._camera.fill(camera)

    def draw(self, primitive: Primitive, uniforms: Mapping[str, Uniform]) -> None:
        """Draw a primitive with uniforms for its program."""
        if not primitive.count:
            return
        if not primitive._in_context():
            primitive._add_to_context()
        _switch(GL.GL_BLEND, primitive.blend)
        _switch(GL.GL_CULL_FACE, primitive.cull)
        GL.glDepthMask(not primitive.blend)
        if primitive.texture is not None:
            primitive.texture.bind()
        for name, first, count in primitive.spans:
            if count:
                self._program(name).use(uniforms)
                primitive.draw(first, count)

    def _program(self, name: str) -> ShaderProgram:
        if name not in self._programs:
            self._programs[name] = ShaderProgram(name, self._constants)
        return self._programs[name]

    def flatten(self) -> None:
        """Have all so far drawn, and go on with one sample a pixel: what comes has soft edges.

        Translucent layers and panels cost some times as much on several samples a pixel. With one
        sample nothing is sent off here: software OpenGL would write all pixels and read them
        again, which takes a tenth of the time of a frame.
        """
        if not self._samples:
            return
        # One pass over both colours and depths takes three quarters of the time of blitting them.
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._main_fb)
        for unit, texture in enumerate(self._samples_taken):
            GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
            GL.glBindTexture(GL.GL_TEXTURE_2D_MULTISAMPLE, texture)
        GL.glActiveTexture(GL.GL_TEXTURE0)
        GL.glDepthFunc(GL.GL_ALWAYS)
        self.draw(self._resolving, {"colours": 0, "depths": 1})
        GL.glDepthFunc(GL.GL_LEQUAL)

    def overlay(self, box: tuple[int, int, int, int] | None) -> None:
        """Go on without depth, in a box left, top, width, height [pixels] or in the whole."""
        GL.glDisable(GL.GL_DEPTH_TEST)
        if box is None:
            GL.glDisable(GL.GL_SCISSOR_TEST)
            GL.glViewport(0, 0, self.viewport_width, self.viewport_height)
        else:
            GL.glEnable(GL.GL_SCISSOR_TEST)
            GL.glScissor(*box)
            GL.glViewport(*box)

    def finish(self) -> Picture:
        """The picture (h, w, 4) uint8; it is written over by the next one."""
        self.overlay(None)
        width, height = self.viewport_width, self.viewport_height
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        place = ctypes.c_void_p(self._picture.ctypes.data)
        GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, place)
        return self._picture

    def delete(self) -> None:
        """Free what the driver holds; the context stays."""
        for program in self._programs.values():
            program.delete()
        self._programs = {}
        if self._camera is not None:
            self._camera.delete()
            self._camera = None
        # What was first drawn in the last picture is known to the scene alone.
        self._meshes = self._meshes if self._scene is None else self._scene.meshes
        for mesh in self._meshes:
            for primitive in mesh.primitives:
                if primitive.texture is not None:
                    primitive.texture.delete()
        super().delete()

    def _free_all_but(self, meshes: set[Any]) -> None:
        """Free the primitives of meshes that are no longer in the scene."""
        for mesh in self._meshes - meshes:
            for primitive in mesh.primitives:
                primitive.delete()
        self._meshes = meshes

    def _configure_main_framebuffer(self) -> None:
        """Make the buffers to draw in: with samples a second pair, depth only where drawn."""
        if self._main_fb is not None:
            return
        size = (self.viewport_width, self.viewport_height)
        self._main_fb_dims = size
        self._main_fb, self._buffers = _framebuffer(size)
        if self._samples:
            self._main_fb_ms, self._samples_taken = _sampled_framebuffer(size, self._samples)
            corners = np.array([[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]], np.float32)
            self._resolving = Primitive("resolve", (2,), corners)

    def _delete_main_framebuffer(self) -> None:
        frames = [each for each in (self._main_fb, self._main_fb_ms) if each is not None]
        if frames:
            GL.glDeleteFramebuffers(len(frames), frames)
            GL.glDeleteRenderbuffers(len(self._buffers), self._buffers)
        if self._samples_taken:
            GL.glDeleteTextures(self._samples_taken)
            self._resolving.delete()
        self._main_fb = self._main_fb_ms = None
        self._buffers, self._samples_taken = [], []


_ATTACHMENTS = (
    (GL.GL_RGBA8, GL.GL_COLOR_ATTACHMENT0),
    (GL.GL_DEPTH_COMPONENT24, GL.GL_DEPTH_ATTACHMENT),
)
"""What a framebuffer holds of each pixel or sample: its colour and its depth."""


def _framebuffer(size: tuple[int, int]) -> tuple[int, list[int]]:
    """A framebuffer, and the buffers of its colour and its depth."""
    frame = GL.glGenFramebuffers(1)
    buffers = GL.glGenRenderbuffers(len(_ATTACHMENTS)).tolist()
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, frame)
    for buffer, (kind, place) in zip(buffers, _ATTACHMENTS, strict=True):
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, *size)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, buffer)
    return frame, buffers


def _sampled_framebuffer(size: tuple[int, int], samples: int) -> tuple[int, list[int]]:
    """A framebuffer of several samples a pixel, and the textures of their colours and depths."""
    frame = GL.glGenFramebuffers(1)
    textures = GL.glGenTextures(len(_ATTACHMENTS)).tolist()
    kind_of_texture = GL.GL_TEXTURE_2D_MULTISAMPLE
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, frame)
    for texture, (kind, place) in zip(textures, _ATTACHMENTS, strict=True):
        GL.glBindTexture(kind_of_texture, texture)
        GL.glTexImage2DMultisample(kind_of_texture, samples, kind, *size, True)
        GL.glFramebufferTexture2D(GL.GL_FRAMEBUFFER, place, kind_of_texture, texture, 0)
    return frame, textures


def _switch(what: int, on: bool) -> None:
    if on:
        GL.glEnable(what)
    else:
        GL.glDisable(what)
