"""Drawing: what films, panels and insets ask of a renderer, whatever it draws with."""

from collections.abc import Mapping
from typing import Any, Protocol

from lrf3d.geometry import Float
from lrf3d.render.pictures import Picture
from lrf3d.render.primitives import Primitive


class Drawing(Protocol):
    """Draws scenes of primitives into pictures, in the order of its methods."""

    def begin(self, scene: Any) -> None:
        """Start a picture."""
        ...

    def camera_matrices(self, scene: Any) -> tuple[Float, Float]:
        """Matrix (4, 4) from the scene to the picture turned over, and the eye (3,)."""
        ...

    def draw(self, primitive: Primitive, uniforms: Mapping[str, Any]) -> None:
        """Draw a primitive with uniforms for its program."""
        ...

    def flatten(self) -> None:
        """Go on with one sample a pixel: what comes has soft edges of its own."""
        ...

    def overlay(self, box: tuple[int, int, int, int] | None) -> None:
        """Go on without depth, in a box left, top, width, height [pixels] or in the whole."""
        ...

    def finish(self) -> Picture:
        """The picture (h, w, 4) uint8; it is written over by the next one."""
        ...

    def delete(self) -> None:
        """Free what is held."""
        ...
