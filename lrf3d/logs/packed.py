"""Lines of a file, packed with gzip or not, within bounds of memory and time."""

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from lrf3d.errors import InputError

LONGEST_LINE = 1 << 20
"""Bytes of a line beyond which it is cut: a scan of 100,000 beams is shorter."""

LARGEST_RATIO = 100
"""How many times its packed size a file may unpack to: recorded scans come to 5 times, those of
a robot that stands still to some tens, a bomb of zeros to 1,000."""

UNSUSPICIOUS = 1 << 23
"""Bytes that any file may unpack to, however small: they take no time worth speaking of."""

GZIP = b"\x1f\x8b"
"""How packed files begin; the name of a file may say otherwise."""


class Line(NamedTuple):
    """A line of a file: its number from 1, its bytes, and what is wrong with it, if anything."""

    number: int
    text: bytes
    fault: str = ""


def lines_of(path: Path) -> Iterator[Line]:
    """Go through the lines of a file without holding more than one of them.

    A line that is too long comes cut, with a fault; where packed data are damaged or break off,
    a last line says so.

    Raises:
        InputError: The file cannot be read, or unpacks to far more than a log would.
    """
    try:
        with path.open("rb") as file:
            packed = file.read(len(GZIP)) == GZIP
            file.seek(0)
            if not packed:
                yield from _lines(file)
                return
            allowed = max(UNSUSPICIOUS, LARGEST_RATIO * path.stat().st_size)
            with gzip.open(file) as unpacked:
                for line in _lines(unpacked):
                    if unpacked.tell() > allowed:
                        raise InputError(
                            f"{path}: line {line.number}: unpacks to over {LARGEST_RATIO} times"
                            " its size, which no log does; unpack it first if it is one"
                        )
                    yield line
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: a folder, expected a log") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def _lines(stream: BinaryIO | gzip.GzipFile) -> Iterator[Line]:
    number, inside = 0, False
    while True:
        try:
            text = stream.readline(LONGEST_LINE)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            yield Line(number + 1, b"", f"the packed data are damaged from here on ({error})")
            return
        if not text:
            return
        whole = text.endswith(b"\n")
        if inside:
            # The rest of a line that was cut. It is handed on, so that whoever counts bytes sees
            # them, but under the same number and with no text.
            yield Line(number, b"")
        else:
            number += 1
            long = not whole and len(text) == LONGEST_LINE
            yield Line(number, text, f"longer than {LONGEST_LINE} bytes" if long else "")
        inside = not whole
