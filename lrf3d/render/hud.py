"""Text and the frame of the inset, laid over a picture."""

from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from lrf3d.geometry import Int, Single
from lrf3d.scene.moments import Window
from lrf3d.scene.shapes import Label, Pixels, single

_LINE, _LESSER = 1.36, 0.8
"""Height of a line in letters, and the size of all lines but the first."""

_GAP = 16
"""Free border round text and the inset [pixels of 720 lines]."""

_LEAST_SCALE, _LEAST_LETTER = 0.47, 6.5
"""Text is at least this number of times its size at 720 lines; smaller letters [pixels] are left
out.
"""

_MOST_COVERED = 0.5
"""Text that would cover more of the height of a picture is left out."""

_DARKEST, _SHADED = 0.62, 1.6
"""How much the picture is darkened in the corner under text, and how far, in the text's size."""

_RIM, _BAR, _SCALE_LETTER = (38, 50, 72), (150, 166, 192), 20
"""Colours of the frame of the inset and of its scale, and the height of the letters of that [pixels
of 720 lines]."""


def scale_of(size: tuple[int, int]) -> float:
    """How many times its size at 720 lines text is in a picture of a size [pixels]."""
    return max(_LEAST_SCALE, min(size) / 720.0)


def gap_of(size: tuple[int, int]) -> int:
    """Free border round panels [pixels]."""
    return round(_GAP * scale_of(size))


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    """The sans face of the page, which comes with matplotlib; that is not imported."""
    spec = find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(folder / "DejaVuSans.ttf", size)


class Words(NamedTuple):
    """A line of text: its width [pixels], the pixels (n,) that letters cover, and how much."""

    width: int
    places: tuple[Int, ...]
    cover: Single
    """(n, 1) share of each that is covered, 0…1."""


@lru_cache(maxsize=64)
def _words(text: str, size: int) -> Words:
    font = _font(size)
    picture = Image.new("L", (int(font.getlength(text)) + 1, round(_LINE * size)))
    ImageDraw.Draw(picture).text((0, 0), text, font=font, fill=255)
    pixels = np.asarray(picture)
    # Most pixels of a line are free: blending all of them takes five times as long.
    places = np.nonzero(pixels)
    return Words(picture.width, places, single(pixels[places][:, None] / 255.0))


def lay_label(picture: Pixels, label: Label) -> None:
    """Lay text over the lower left corner of a picture, on a soft gradient."""
    size, gap = (picture.shape[1], picture.shape[0]), gap_of(picture.shape[1::-1])
    left, letters = round(1.4 * gap), [scale_of(size) * label.size]
    letters += [_LESSER * letters[0]] * (len(label.text) - 1)
    wide = max(
        _font(100).getlength(line) * high / 100
        for line, high in zip(label.text, letters, strict=True)
    )
    fits = min(1.0, (size[0] - 2 * left) / max(wide, 1.0))
    heights = [int(fits * high) for high in letters]
    high = sum(round(_LINE * each) for each in heights)
    if min(heights) < _LEAST_LETTER or high > _MOST_COVERED * size[1]:
        return
    shading = _shading(round(_SHADED * fits * wide), round(_SHADED * high) + gap)
    part = picture[-len(shading) :, : shading.shape[1], :3]
    part[:] = (part * shading[-len(part) :, : part.shape[1]]) >> 8
    top = size[1] - round(1.2 * gap) - high
    for line, colour, each in zip(label.text, label.colours, heights, strict=True):
        _write(picture, line, each, (left, top), colour)
        top += round(_LINE * each)


@lru_cache(maxsize=8)
def _shading(wide: int, high: int) -> NDArray[np.uint16]:
    """What is left of the light (high, wide, 1) under text, of 256."""
    x, y = 1.0 - np.arange(wide) / wide, np.arange(high) / high
    dark = _DARKEST * np.outer(y * y * (3.0 - 2.0 * y), x * x * (3.0 - 2.0 * x))
    return np.round(256.0 * (1.0 - dark)).astype(np.uint16)[..., None]


def lay_frame(picture: Pixels, box: tuple[int, int, int, int], window: Window) -> None:
    """Frame the inset in a box, left, top, width and height [pixels], which shows a window."""
    left, top, wide, high = box
    scale = scale_of(picture.shape[1::-1])
    rim, pad = max(1, round(1.2 * scale)), round(10 * scale)
    part = picture[top : top + high, left : left + wide, :3]
    part[:rim] = part[-rim:] = part[:, :rim] = part[:, -rim:] = _RIM
    # Under the inset, so that it hides nothing of the map.
    letters = max(round(_SCALE_LETTER * scale), 9)
    below, length = top + high + pad // 2, round(window.bar / window.width * wide)
    right, words = left + wide, f"{window.bar:g} m"
    picture[below : below + 2 * rim, right - length : right, :3] = _BAR
    place = right - length - _words(words, letters).width - pad // 2, below - round(0.6 * letters)
    _write(picture, words, letters, place, _BAR)


def _write(
    part: Pixels, text: str, letters: int, place: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    """Write a line of text into a part of a picture, from a place to the right and down."""
    words = _words(text, letters)
    part = part[place[1] :, place[0] :, :3]
    under = part[words.places]
    part[words.places] = under + words.cover * (np.array(colour, np.float32) - under)
