"""Lines of a file, gzipped or not, with limits on memory and time."""

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple, cast

from lrf3d.errors import InputError
from lrf3d.files import opened

LONGEST_LINE = 1 << 20
"""Length of the longest line [bytes]: more than 100,000 beams."""

LARGEST_RATIO = 100
"""Largest ratio of the sizes of unpacked and packed data: that of recorded scans is 5, for a robot
at rest some tens, for a decompression bomb 1,000."""

SMALL_LOG = 1 << 23
"""Bytes that any file may unpack to, regardless of its size: they take hardly any time."""

GZIP = b"\x1f\x8b"
"""First bytes of gzipped files, whatever their name is."""


class LogLine(NamedTuple):
    """A line of a file: its number from 1, its bytes, and what is wrong with it, if anything."""

    number: int
    text: bytes
    fault: str = ""


def lines_of(path: Path) -> Iterator[LogLine]:
    """Yield the lines of a file, of which only one is in memory.

    A line that is too long has no text, but a fault; if packed data are damaged or truncated, a
    last line reports it.

    Raises:
        InputError: The file cannot be read, or unpacks to far more than a log would.
    """
    with opened(path, what="a log") as file:
        packed = file.read(len(GZIP)) == GZIP
        file.seek(0)
        stream = cast("BinaryIO", gzip.open(file)) if packed else file
        allowed = max(SMALL_LOG, LARGEST_RATIO * path.stat().st_size)
        number, total, long = 1, 0, False
        while True:
            try:
                text = stream.readline(LONGEST_LINE)
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                yield LogLine(number, b"", f"the packed data are damaged from here on ({error})")
                return
            if not text:
                return
            total += len(text)
            if total > allowed:
                raise InputError(
                    f"{path}: line {number}: unpacks to over {LARGEST_RATIO} times its size, which"
                    " no log does; unpack it first if it is one"
                )
            ends = text.endswith(b"\n")
            if long or (not ends and len(text) == LONGEST_LINE):
                if not long:
                    yield LogLine(number, b"", f"longer than {LONGEST_LINE} bytes")
            else:
                yield LogLine(number, text)
            number, long = number + ends, not ends
