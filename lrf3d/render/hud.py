"""Text and the frame of the inset, laid over a picture."""

from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from lrf3d.scene.moments import Window
from lrf3d.scene.shapes import Label, Pixels

_LINE, _LESSER, GAP = 1.36, 0.8, 16
"""Height of a line in letters, the size of all lines but the first, and the free border round text
and the inset [pixels of 720 lines]."""

_LEAST_SCALE, _LEAST_LETTER, _MOST_COVERED = 0.47, 6.5, 0.5
"""Text is at least this number of times its size at 720 lines; text of smaller letters [pixels], or
that would cover more of the height of a picture, is left out."""

_DARKEST, _SHADED = 0.74, 1.6
"""How much the picture is darkened in the corner under text, and how far, in the text's size."""


def scale_of(size: tuple[int, int]) -> float:
    """How many times its size at 720 lines text is in a picture of a size [pixels]."""
    return max(_LEAST_SCALE, min(size) / 720.0)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    """The sans face of the page, which comes with matplotlib; that is not imported."""
    spec = find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(folder / "DejaVuSans.ttf", size)


@lru_cache(maxsize=16)
def _label(label: Label, size: tuple[int, int]) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Text on a soft gradient, in the lower left corner of a picture of a size [pixels].

    What is left of the picture under it (h, w, 1), of 256, and what is added (h, w, 3).
    """
    gap, letters = round(GAP * scale_of(size)), [scale_of(size) * label.size]
    left = round(1.4 * gap)
    letters += [_LESSER * letters[0]] * (len(label.text) - 1)
    wide = max(
        _font(100).getlength(line) * high / 100
        for line, high in zip(label.text, letters, strict=True)
    )
    fits = min(1.0, (size[0] - 2 * left) / max(wide, 1.0))
    heights = [int(fits * high) for high in letters]
    high = sum(round(_LINE * each) for each in heights)
    if min(heights) < _LEAST_LETTER or high > _MOST_COVERED * size[1]:
        return np.zeros((0, 0, 1), np.uint16), np.zeros((0, 0, 3), np.uint16)
    shape = round(_SHADED * fits * wide), round(_SHADED * high) + gap
    x, y = (np.arange(side) / side for side in shape)
    shade = _DARKEST * np.outer(y * y * (3.0 - 2.0 * y), (1.0 - x) ** 2 * (1.0 + 2.0 * x))
    kept = 256.0 * (1.0 - shade[..., None])
    picture, cover = Image.new("RGB", shape), Image.new("L", shape)
    place = left, shape[1] - round(1.2 * gap) - high
    for line, colour, each in zip(label.text, label.colours, heights, strict=True):
        for layer, fill in ((picture, colour), (cover, 255)):
            ImageDraw.Draw(layer).text(place, line, font=_font(each), fill=fill)
        place = place[0], place[1] + round(_LINE * each)
    covered = np.asarray(cover)[..., None] / 255.0
    return (
        (kept * (1.0 - covered)).astype(np.uint16)[-size[1] :, : size[0]],
        np.asarray(picture, np.uint16)[-size[1] :, : size[0]],
    )


def lay_label(picture: Pixels, label: Label) -> None:
    """Lay text over the lower left corner of a picture, on a soft gradient."""
    kept, added = _label(label, picture.shape[1::-1])
    if len(kept):
        part = picture[-len(kept) :, : kept.shape[1], :3]
        part[:] = ((part * kept) >> 8) + added


def lay_frame(picture: Pixels, box: tuple[int, int, int, int], window: Window) -> None:
    """Frame the inset in a box, left, top, width and height [pixels], which shows a window."""
    left, top, wide, high = box
    scale = scale_of(picture.shape[1::-1])
    rim, pad = max(1, round(1.2 * scale)), round(10 * scale)
    part = picture[top : top + high, left : left + wide, :3]
    # Colours of the frame of the inset and of its scale, and the height of the letters of that
    # [pixels of 720 lines].
    rim_colour, bar_colour, scale_letter = (38, 50, 72), (200, 210, 228), 20
    part[:rim] = part[-rim:] = part[:, :rim] = part[:, -rim:] = rim_colour
    # Under the inset, so that it hides nothing of the map, and darkened, so that it is legible.
    letters, words = max(round(scale_letter * scale), 9), f"{window.bar:g} m"
    foot = picture[top + high : top + high + letters + pad, left : left + wide, :3]
    foot[:] = ((1.0 - _DARKEST) * foot).astype(np.uint8)
    middle, end = len(foot) // 2, foot.shape[1] - pad
    begin = end - round(window.bar / window.width * wide)
    foot[middle - rim : middle + rim, begin:end] = bar_colour
    text = Image.fromarray(np.ascontiguousarray(foot[:, :begin]))
    place = text.width - pad, middle
    ImageDraw.Draw(text).text(place, words, font=_font(letters), fill=bar_colour, anchor="rm")
    foot[:, :begin] = np.asarray(text)
