"""Pictures as text that a web page embeds, so that the page needs no other file."""

import base64
from io import BytesIO

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

QUALITY = 90
"""Quality of JPEG pictures: no blocks are seen in skies at it."""

DOTS_PER_INCH = 130
"""Of figures that are made of dots: two a pixel of the usual screen at the width of a page."""


def embed_figure(figure: Figure, *, lines: bool = True) -> str:
    """A figure as a data URI: SVG, or PNG where it is made of too much for lines."""
    file = BytesIO()
    if lines:
        # A fixed salt, so that the same figure gives the same text.
        with rc_context({"svg.hashsalt": "lrf3d"}):
            figure.savefig(file, format="svg", metadata={"Date": None})
    else:
        figure.savefig(file, format="png", dpi=DOTS_PER_INCH)
    return _uri(file, "svg+xml" if lines else "png")


def embed_frame(frame: NDArray[np.uint8]) -> str:
    """A frame (h, w, 3) of a film as a data URI: JPEG."""
    from PIL import Image

    file = BytesIO()
    Image.fromarray(frame).save(file, format="JPEG", quality=QUALITY)
    return _uri(file, "jpeg")


def _uri(file: BytesIO, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"
