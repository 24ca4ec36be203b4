"""Pixels of pictures: of maps of cells, and of plans."""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageOps

from lrf3d.base.errors import WorldError
from lrf3d.base.files import opened
from lrf3d.world.free_cells import MOST_CELLS


def pixels_of(picture: Path, *, deep: bool = False) -> Any:
    """The colours and the opacity of the pixels of a picture (rows, columns, 2 or 4).

    They are numbers of 8 bits; of 16 bits, where it has them and deep ones are asked for.
    """
    with opened(picture, what="a picture", largest=1 << 28) as file:
        try:
            with Image.open(file, formats=["PNG", "PPM", "BMP", "JPEG"]) as image:
                if image.width * image.height > MOST_CELLS:
                    raise WorldError(f"{picture}: {image.size} cells, over {MOST_CELLS:,}; cut it")
                _check_size(picture, image)
                if image.mode.startswith("I"):
                    grey = np.asarray(image).clip(0, 65535).astype(np.uint16)
                    grey = grey if deep else (grey >> 8).astype(np.uint8)
                    return np.stack([grey, np.full_like(grey, np.iinfo(grey.dtype).max)], axis=-1)
                plain = image.convert("RGB") if image.mode in ("CMYK", "YCbCr", "LAB") else image
                upright = ImageOps.exif_transpose(plain)
                return np.asarray(upright.convert("LA" if upright.mode in ("1", "L") else "RGBA"))
        except WorldError:
            raise
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0][:80]
            raise WorldError(f"{picture}: not a PGM, PNG, JPEG or BMP picture ({reason})") from None


def _check_size(picture: Path, image: Any) -> None:
    """Check that a PGM holds as many pixels as its header says; others would be drawn askew."""
    (codec, _, begin, mode), *_ = image.tile
    if image.format == "PPM" and codec == "raw":
        expected = image.width * image.height * (2 if "16" in str(mode) else len(image.getbands()))
        found = picture.stat().st_size - begin
        # A line break behind the pixels is harmless.
        if not expected <= found <= expected + 2:
            sizes = f"{found:,} bytes of pixels, {expected:,} by its header"
            raise WorldError(f"{picture}: {sizes}; save the picture again")
