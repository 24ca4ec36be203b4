"""Text and the frame of the inset, laid over a picture."""

from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lrf3d.geometry import Int, Single
from lrf3d.scene.shapes import Label, Pixels, single

_BACK, _LINE = 13, 1.36
"""What panels add to a quarter of the brightness under them, 0…255; height of a line in letters."""

_PAD, _GAP = 12, 16
"""Border in panels, and free border round them [pixels of 720 lines]."""

_LEAST_SCALE, _LEAST_LETTER = 0.47, 6.5
"""Text is at least this number of times its size at 720 lines; smaller letters [pixels] are left
out.
"""

_MOST_COVERED = 0.5
"""A panel that would cover more of the height of a picture is left out."""

_WIDTH = 0.61
"""Width of a letter, in its height."""

_RIM, _BAR = (120, 130, 145), (190, 200, 215)
"""Colours of the frame of the inset and of its scale."""


def scale_of(size: tuple[int, int]) -> float:
    """How many times its size at 720 lines text is in a picture of a size [pixels]."""
    return max(_LEAST_SCALE, min(size) / 720.0)


def gap_of(size: tuple[int, int]) -> int:
    """Free border round panels [pixels]."""
    return round(_GAP * scale_of(size))


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    """A font whose letters are equally wide, which comes with matplotlib; that is not imported."""
    spec = find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(folder / "DejaVuSansMono-Bold.ttf", size)


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


def lay_labels(picture: Pixels, labels: tuple[Label, ...], taken: int) -> None:
    """Lay labels over a picture whose upper right corner is taken for so many pixels."""
    size, gap = (picture.shape[1], picture.shape[0]), gap_of(picture.shape[1::-1])
    scale = scale_of(size)
    pad = round(_PAD * scale)
    for label in labels:
        room = size[0] - 2 * gap - (taken + gap if label.place == "top" and taken else 0)
        longest = max(len(line) for line in label.text)
        letters = int(min(scale * label.size, (room - 2 * pad) / (_WIDTH * longest)))
        high = 2 * pad + round(_LINE * letters * len(label.text))
        if letters < _LEAST_LETTER or high > _MOST_COVERED * size[1]:
            continue
        wide = 2 * pad + max(_words(line, letters).width for line in label.text)
        left, top = gap, gap
        if label.place == "middle":
            left, top = (size[0] - wide) // 2, size[1] - 2 * gap - high
        part = picture[top : top + high, left : left + wide]
        np.right_shift(part, 2, out=part)
        np.add(part, _BACK, out=part)
        for row, (line, colour) in enumerate(zip(label.text, label.colours, strict=True)):
            _write(part, line, letters, (pad, pad + round(row * _LINE * letters)), colour)


def lay_frame(picture: Pixels, box: tuple[int, int, int], window: float) -> None:
    """Frame the inset in a box, left, top and side [pixels], which shows a window [m]."""
    left, top, side = box
    scale = scale_of(picture.shape[1::-1])
    rim, pad = max(1, round(2 * scale)), round(10 * scale)
    part = picture[top : top + side, left : left + side, :3]
    part[:rim] = part[-rim:] = part[:, :rim] = part[:, -rim:] = _RIM
    # The longest of 1, 2 and 5 times a power of ten that takes up to a third of the side.
    power = 10.0 ** np.floor(np.log10(window / 3.0))
    metres = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= window / 3.0)
    part[-pad - rim : -pad, pad : pad + round(metres / window * side)] = _BAR
    letters = max(round(20 * scale), 7)
    place = pad, side - pad - rim - round(_LINE * letters)
    _write(part, f"{metres:g} m", letters, place, _BAR)


def _write(
    part: Pixels, text: str, letters: int, place: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    """Write a line of text into a part of a picture, from a place to the right and down."""
    words = _words(text, letters)
    part = part[place[1] :, place[0] :, :3]
    under = part[words.places]
    part[words.places] = under + words.cover * (np.array(colour, np.float32) - under)
