"""What a notebook shows of a value: its picture, and a film that plays in the page.

A notebook asks the value itself for its picture, but drawing is the work of layers above it. The
module that draws is therefore named here and imported when a notebook asks, and not before.
"""

from base64 import b64encode
from dataclasses import dataclass, field
from importlib import import_module


class Pictured:
    """Base of values that a notebook shows as a small figure, see :func:`lrf3d.plot.png`."""

    __slots__ = ()

    def _repr_png_(self) -> bytes:
        picture: bytes = import_module("lrf3d.plot").png(self)
        return picture


@dataclass(frozen=True, slots=True)
class Video:
    """A film that a notebook plays in its page.

    Args:
        data: The bytes of an .mp4 file.
        size: Width and height of the film [pixels].
    """

    data: bytes = field(repr=False)
    size: tuple[int, int]

    def _repr_html_(self) -> str:
        width, height = self.size
        source = f"data:video/mp4;base64,{b64encode(self.data).decode('ascii')}"
        return (
            f'<video controls loop muted width="{width}" height="{height}" src="{source}"></video>'
        )
