"""Text in pictures: rows of words in their colours, over a picture or on the ground of maps."""

from functools import cache, lru_cache
from importlib.util import find_spec
from itertools import compress, groupby
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lrf3d.studio.scene.look import PLAN_BACK, TINY, WHITE, scale
from lrf3d.studio.scene.shapes import NAMED, Label, Pixels
from lrf3d.studio.scene.timeline import smoothed

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

# Largest share of the height of a picture that text may cover; more is left out.
_MOST_COVERED = 0.5

# Share of the picture's light that is taken in the corner under text.
_DARKEST = 0.74

# Size of the darkened corner, in the text's.
_SHADED = 1.6

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


def _length(words: Words, apart: str) -> float:
    """The length of a row of words, in its letters."""
    return _font(100).getlength(apart.join(text for text, _ in words)) / 100


def _draw(
    picture: Image.Image, words: Words, place: float, top: int, letter: int, apart: str
) -> None:
    """Draw a row of words from a place on [pixels], with what stands between them."""
    for text, colour in words:
        colour = (*colour, 255)[: len(picture.getbands())]
        ImageDraw.Draw(picture).text((place, top), text, font=_font(letter), fill=colour)
        place += round(_font(letter).getlength(text + apart))


@lru_cache(maxsize=64)
def row_of(words: Words, letter: float, wide: int) -> Pixels:
    """A row (h, w, 3) on the ground of maps, in letters that fit in; none if they are too small."""
    fitting = min(letter, wide / max(_length(words, " "), 1.0))
    shape = wide, round(LINE * letter) * (fitting >= _LEAST_LETTER)
    picture = Image.new("RGB", shape, PLAN_BACK)
    _draw(picture, words, 0.0, 0, int(fitting), " ")
    return np.asarray(picture)


def _rows(label: Label) -> list[Words]:
    """The rows of a label: what names colours stands in one row."""
    lines = enumerate(zip(label.text, label.colours, strict=True))
    groups = groupby(lines, lambda each: -1 if each[1][0].startswith(NAMED) else each[0])
    return [tuple(line for _, line in group) for _, group in groups]


@lru_cache(maxsize=16)
def _label(label: Label, size: tuple[int, int]) -> tuple[Image.Image, Image.Image] | None:
    """Text on a soft gradient, in the lower left corner of a picture of a size [pixels].

    Its colours, and how much of the picture under it they cover; None if there is no room.
    """
    gap = gap_of(size)
    rows = _rows(label)
    letters = scale_of(size) * label.size * np.array([1.0] + [_LESSER] * (len(rows) - 1))
    lengths = np.array([_length(words, _APART) for words in rows])
    letters = np.minimum(letters, (size[0] - 2 * gap) / np.maximum(lengths, 1.0))
    legible = letters >= _LEAST_LETTER
    heights = letters[legible].astype(int).tolist()
    high = sum(round(LINE * each) for each in heights)
    if not heights or high > _MOST_COVERED * size[1]:
        return None
    wide = float((letters * lengths)[legible].max())
    shape = round(_SHADED * wide), round(_SHADED * high) + gap
    x, y = (np.arange(side) / side for side in shape)
    shade = _DARKEST * np.outer(smoothed(y), (1.0 - x) ** 2 * (1.0 + 2.0 * x))
    # The fourth channel is how much of a pixel the letters cover.
    picture = Image.new("RGBA", shape)
    top = shape[1] - gap - high
    for words, each in zip(compress(rows, legible), heights, strict=True):
        _draw(picture, words, gap, top, each, _APART)
        top += round(LINE * each)
    *colours, letter = np.moveaxis(np.asarray(picture)[-size[1] :, : size[0]] / WHITE, 2, 0)
    share = 1.0 - (1.0 - shade[-size[1] :, : size[0]]) * (1.0 - letter)
    tints = np.dstack(colours) * (letter / np.maximum(share, TINY))[..., None]
    tint, cover = (
        Image.fromarray(np.rint(WHITE * each).astype(np.uint8)) for each in (tints, share)
    )
    return tint, cover


def lay_label(picture: Pixels, label: Label) -> None:
    """Lay text over the lower left corner of a picture, on a soft gradient."""
    laid = _label(label, picture.shape[1::-1])
    if laid is not None:
        tint, cover = laid
        part = picture[-tint.height :, : tint.width]
        under = Image.fromarray(part)
        under.paste(tint, mask=cover)
        part[:] = np.asarray(under)
