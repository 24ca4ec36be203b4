"""Text of pictures: rows of words in their colours, in a band under them or beside their maps."""

from functools import cache, lru_cache
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFont

from lrf3d.studio.scene.look import PLAN_BACK, scale
from lrf3d.studio.scene.pins import Pins
from lrf3d.studio.scene.shapes import NAMED, Label, Lens, Pixels

# Height of a line in letters.
LINE = 1.36

# What stands between texts of a row.
_APART = "   "

# Size of all lines but the first, in that of the first.
_LESSER = 0.64

# Free border round text and maps [pixels of 720 lines].
_GAP = 16

# Least number of times its size at 720 lines that text has.
_LEAST_SCALE = 0.47

# Height of letters from which on text is legible; smaller text is left out [pixels].
_LEAST_LETTER = 6.5

# Height of the band of text under a picture [pixels of 720 lines].
_BAND = 132

# Its largest height, in the smaller side of the picture.
_BAND_SHARE = 0.3

# Its least height, with one legible line [pixels].
_LEAST_BAND = 16

# Free border of the text, in the height of the band.
_MARGIN = 0.12

# Height of the letters of maps and pins [pixels of 720 lines].
LETTER = 25.0

# Words and their colours, 0…255.
Words = tuple[tuple[str, tuple[int, ...]], ...]


def scale_of(size: tuple[int, int]) -> float:
    """How many times its size at 720 lines text is in a picture of a size [pixels]."""
    return scale(size, _LEAST_SCALE)


def gap_of(size: tuple[int, int]) -> int:
    """The free border round text in a picture of a size [pixels]."""
    return round(_GAP * scale_of(size))


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    """The sans face of the page, which comes with matplotlib; that is not imported."""
    spec = find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(folder / "DejaVuSans.ttf", size)


def length_of(words: Words, apart: str = " ") -> float:
    """The length of a row, in the height of its letters."""
    return max(_font(100).getlength(apart.join(text for text, _ in words)) / 100, 1.0)


@lru_cache(maxsize=64)
def row_of(words: Words, letter: float, wide: float, apart: str = " ") -> Image.Image:
    """A row on a clear ground, in letters that fit in a width; empty where they are too small."""
    length = length_of(words, apart)
    fitting = min(letter, wide / length)
    high = round(LINE * min(letter, int(fitting))) * (fitting >= _LEAST_LETTER)
    picture = Image.new("RGBA", (max(round(length * fitting), 0) + 1, high))
    if not high:
        return picture
    font = _font(int(fitting))
    place = 0
    for text, colour in words:
        ImageDraw.Draw(picture).text((place, 0), text, font=font, fill=(*colour, 255))
        place += round(font.getlength(text + apart))
    return picture


def stacked(rows: list[Image.Image], size: tuple[int, int], gap: int) -> Pixels:
    """Rows one under the other on the ground of maps, of a size, with a gap [pixels]."""
    picture = Image.new("RGB", size, PLAN_BACK)
    top = gap // 2
    for row in rows:
        picture.paste(row, (gap, top), row if row.mode == "RGBA" else None)
        top += row.height
    return np.asarray(picture)


def _rows(label: Label) -> list[Words]:
    """The rows of a label: what names colours stands in one row."""
    lines = enumerate(zip(label.text, label.colours, strict=True))
    groups = groupby(lines, lambda each: -1 if each[1][0].startswith(NAMED) else each[0])
    return [tuple(line for _, line in group) for _, group in groups]


def band_of(size: tuple[int, int]) -> int:
    """Height of the band of text under a picture of a size; 0 where no text would be legible."""
    high = round(min(_BAND * scale_of(size), _BAND_SHARE * min(size)))
    return high * (high >= _LEAST_BAND)


def banded(label: Label, size: tuple[int, int], scale: float) -> Pixels:
    """A band of text (h, w, 3) of a size [pixels]; letters are scaled, and smaller where many."""
    rows = _rows(label)
    width, height = size
    gap = round(_MARGIN * height)
    letters = scale * label.size * np.array([1.0] + [_LESSER] * (len(rows) - 1))
    letters *= min(1.0, (height - gap) / (LINE * letters.sum()))
    drawn = [
        row_of(words, each, width - 2 * gap, _APART)
        for words, each in zip(rows, letters.tolist(), strict=True)
    ]
    return stacked(drawn, size, gap)


def lay_pins(picture: Pixels, pins: Pins, lens: Lens, colour: tuple[int, ...]) -> None:
    """Lay the labels of pins over a picture, where they end, but for those that would overlap."""
    size = picture.shape[1::-1]
    gap = gap_of(size) // 2
    laid = Image.fromarray(picture)
    boxes = list[shapely.Polygon]()
    clips = np.stack([pins.tips, pins.ends]) @ lens.matrix[:, :3].T + lens.matrix[:, 3]
    tips, ends = 0.5 * (1.0 + clips[..., :2] / clips[..., 3:]) * size
    for (x, _), (left, middle), said in zip(tips, ends, pins.words, strict=True):
        row = row_of(((said, colour),), round(LETTER * scale_of(size)), size[0])
        leftwards = left < x or left + gap + row.width > size[0]
        left = min(left, x) - gap - row.width if leftwards else left + gap
        place = np.array([left, middle - row.height / 2])
        place = np.clip(place, 0, np.array(size) - row.size).astype(int)
        box = shapely.box(*place, *(place + row.size))
        if not shapely.intersects(box, boxes).any():
            boxes.append(box)
            laid.paste(PLAN_BACK, (*place, *(place + row.size)))
            laid.paste(row, tuple(place), row)
    picture[:] = np.asarray(laid)
