"""Text and the frame of the inset, drawn by Pillow and laid over a picture."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lrf3d.render.pictures import Picture
from lrf3d.scene.shapes import Label

_BACK, _LINE, _RADIUS = (13, 17, 25, 178), 1.36, 9
"""Colour of panels, height of a line in letters, and radius of corners [pixels of 720 lines]."""

_LEAST_SCALE, _LEAST_LETTER = 0.47, 6.5
"""Text is at least so many times its size at 720 lines; letters below so many pixels are left out.
"""

_GAP = 16
"""Free border round panels [pixels of 720 lines]."""

_MOST_COVERED = 0.5
"""A panel that would cover more of the height of a picture is left out."""

_WIDTH = 0.61
"""Width of a letter, in its height."""

_RIM, _BAR = (120, 130, 145, 255), (190, 200, 215, 255)
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


@cache
def panel_picture(label: Label, size: tuple[int, int], room: int) -> Picture | None:
    """A label (h, w, 4) for a picture of a size, no wider than the room [pixels].

    None where it would be too small to be read, or too large.
    """
    scale = scale_of(size)
    pad = round(12 * scale)
    longest = max(len(line) for line in label.text)
    letters = int(min(scale * label.size, (room - 2 * pad) / (_WIDTH * longest)))
    high = 2 * pad + round(_LINE * letters * len(label.text))
    if letters < _LEAST_LETTER or high > _MOST_COVERED * size[1]:
        return None
    font = _font(letters)
    wide = round(max(font.getlength(line) for line in label.text)) + 2 * pad
    picture = Image.new("RGBA", (wide, high), (*_BACK[:3], 0))
    draw = ImageDraw.Draw(picture)
    draw.rounded_rectangle((0, 0, wide - 1, high - 1), round(_RADIUS * scale), fill=_BACK)
    for row, (line, colour) in enumerate(zip(label.text, label.colours, strict=True)):
        place = pad, pad + row * _LINE * letters
        draw.text(place, line, font=font, fill=(*colour, 255))
    return np.asarray(picture)


def lay_labels(picture: Picture, labels: tuple[Label, ...], taken: int) -> None:
    """Lay labels over a picture whose upper right corner is taken for so many pixels."""
    size, gap = (picture.shape[1], picture.shape[0]), gap_of(picture.shape[1::-1])
    for label in labels:
        room = size[0] - 2 * gap - (taken + gap if label.place == "top" and taken else 0)
        panel = panel_picture(label, size, room)
        if panel is None:
            continue
        left, top = gap, gap
        if label.place == "middle":
            left, top = (size[0] - panel.shape[1]) // 2, size[1] - 2 * gap - panel.shape[0]
        lay_over(picture, panel, left, top)


def lay_over(picture: Picture, panel: Picture, left: int, top: int) -> None:
    """Lay a panel (h, w, 4) over a picture, by its opacity."""
    box = (left, top, left + panel.shape[1], top + panel.shape[0])
    under = Image.fromarray(picture[box[1] : box[3], box[0] : box[2], :3])
    over = Image.fromarray(panel)
    under.paste(over, mask=over.getchannel("A"))
    picture[box[1] : box[3], box[0] : box[2], :3] = np.asarray(under)


@cache
def inset_frame(side: int, window: float, scale: float) -> Picture:
    """The frame of an inset of a side [pixels] that shows a window [m], with a scale."""
    rim = max(1, round(2 * scale))
    picture = Image.new("RGBA", (side, side), (0, 0, 0, 0))
    draw = ImageDraw.Draw(picture)
    draw.rectangle((0, 0, side - 1, side - 1), outline=_RIM, width=rim)
    # The longest of 1, 2 and 5 times a power of ten that takes up to a third of the side.
    power = 10.0 ** np.floor(np.log10(window / 3.0))
    metres = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= window / 3.0)
    pad, letters = round(10 * scale), max(round(17 * scale), 7)
    long, bottom = round(metres / window * side), side - pad
    draw.line((pad, bottom, pad + long, bottom), fill=_BAR, width=rim)
    words = (pad, bottom - rim - _LINE * letters)
    draw.text(words, f"{metres:g} m", font=_font(letters), fill=_BAR)
    return np.asarray(picture)
