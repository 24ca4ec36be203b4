"""The kinds of films by the ending of their file, and the one encoder that writes them all.

Pictures go in one by one and are written at once, so that a film of any length takes no more memory
than a short one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from PIL import Image

from lrf3d.base.errors import InputError
from lrf3d.studio.scene.shapes import Pixels


@dataclass(frozen=True, slots=True)
class FilmFormat:
    """A kind of film, as FFmpeg's libraries write it."""

    codec: str
    # How the codec holds pixels.
    colours: str
    # Most frames a second: browsers show pictures of a shorter time for a tenth of a second.
    fastest: float
    # What times are whole numbers of [s]; the time of a frame if not given.
    unit: Fraction | None = None
    codec_options: dict[str, str] = field(default_factory=dict)
    file_options: dict[str, str] = field(default_factory=dict)
    # Whether width and height have to be even.
    even: bool = False
    # Whether all pictures share 256 colours.
    palette: bool = False


FORMATS = {
    ".gif": FilmFormat(
        "gif", "pal8", 50.0, Fraction(1, 100), file_options={"loop": "0"}, palette=True
    ),
    ".mp4": FilmFormat(
        "libx264",
        "yuv420p",
        1000.0,
        # A short look ahead halves the size that this preset gives, at a fifth less time than the
        # next one; motion in whole pixels takes a fifth less again. At this quality fifteen seconds
        # of a city take 4 MB, without visible loss: the structural similarity (SSIM) to the drawn
        # pictures is 0.97.
        codec_options={
            "preset": "superfast",
            "x264-params": "rc-lookahead=8:mbtree=1:subme=0",
            "crf": "26.2",
            "bf": "0",
            # The processes that draw take all other cores.
            "threads": "1",
        },
        file_options={"movflags": "faststart"},
        even=True,
    ),
    ".webp": FilmFormat(
        "libwebp_anim",
        "yuv420p",
        200.0,
        Fraction(1, 1000),
        # Fifteen seconds of a city take less than 3 MB at half the rate of a film, as READMEs need.
        codec_options={"quality": "60", "compression_level": "4"},
        file_options={"loop": "0"},
    ),
}


# Largest denominator of frames a second.
_RATES = 1000

# Lines of an example from which on not all of its pixels choose the colours of a palette.
_SAMPLED = 360


def format_of(path: Path, size: tuple[int, int], fps: float) -> FilmFormat:
    """The kind of film that a path names.

    Raises:
        InputError: There is no such kind, or it cannot have that size [pixels] or rate [Hz].
    """
    found = FORMATS.get(path.suffix.lower())
    if found is None:
        raise InputError(f"{path}: expected a film that ends in {', '.join(sorted(FORMATS))}")
    if found.even and (size[0] % 2 or size[1] % 2):
        raise InputError(f"size {size[0]}x{size[1]}: H.264 needs even numbers")
    if fps > found.fastest:
        raise InputError(
            f"fps {fps:g}: players show at most {found.fastest:g} frames a second of {path.suffix}"
        )
    return found


def encode(
    pictures: Iterable[Pixels],
    path: Path,
    kind: FilmFormat,
    *,
    fps: float,
    examples: Sequence[Pixels] = (),
) -> None:
    """Write pictures (h, w, 3) as a film; examples of them choose the colours of a palette."""
    rate = Fraction(fps).limit_denominator(_RATES)
    unit = kind.unit or 1 / rate
    palette = None
    if kind.palette:
        # The 256 colours that serve examples best; with one palette none changes between frames.
        step = -(-len(examples[0]) // _SAMPLED)
        seen = Image.fromarray(np.concatenate([each[::step, ::step] for each in examples]))
        palette = seen.quantize(256, method=Image.Quantize.FASTOCTREE)
    with av.open(str(path), "w", format=path.suffix[1:], options=kind.file_options) as film:
        stream: Any = film.add_stream(kind.codec, rate, options=kind.codec_options)
        stream.codec_context.time_base = unit
        for number, picture in enumerate(pictures):
            frame: Any = av.VideoFrame.from_ndarray(picture, format="rgb24")
            if palette is not None:
                # Spreading errors from pixel to pixel would flicker.
                colours = np.full((256, 4), 255, np.uint8)
                colours[:, 1:] = np.resize(palette.getpalette() or [0], (256, 3))
                numbers = Image.fromarray(picture).quantize(
                    palette=palette, dither=Image.Dither.NONE
                )
                indexed: Any = np.asarray(numbers), colours
                frame = av.VideoFrame.from_ndarray(indexed, format="pal8")
            # Rounded from the start, so that it does not add up.
            frame.pts = round(number / (fps * unit))
            frame.duration = round((number + 1) / (fps * unit)) - frame.pts
            frame.time_base = unit
            if number == 0:
                stream.width = frame.width
                stream.height = frame.height
                stream.pix_fmt = kind.colours
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
