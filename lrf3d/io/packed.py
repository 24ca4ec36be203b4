"""Lines of a file, gzipped or not, with limits on memory and time."""

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from lrf3d.errors import InputError
from lrf3d.input import opened

BLOCK_BYTES = 1 << 20
"""Bytes that are read at a time, and length of the longest line: more than 100,000 beams."""

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
    """Yield the lines of a file that are not empty, with one block of it in memory.

    A line that is too long has no text, but a fault; if packed data are damaged or truncated, a
    last line reports it.

    Raises:
        InputError: The file cannot be read, or unpacks to far more than a log would.
    """
    with opened(path, what="a log") as file:
        packed = file.read(len(GZIP)) == GZIP
        file.seek(0)
        if not packed:
            yield from _lines(file, path, None)
            return
        allowed = max(SMALL_LOG, LARGEST_RATIO * path.stat().st_size)
        with gzip.open(file) as unpacked:
            yield from _lines(unpacked, path, allowed)


def _lines(stream: BinaryIO | gzip.GzipFile, path: Path, allowed: int | None) -> Iterator[LogLine]:
    number, total, rest, long = 1, 0, b"", False
    while True:
        fault = ""
        try:
            block = (
                stream.read1(BLOCK_BYTES)
                if isinstance(stream, gzip.GzipFile)
                else stream.read(BLOCK_BYTES)
            )
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            block, fault = b"", f"the packed data are damaged from here on ({error})"
        total += len(block)
        if allowed is not None and total > allowed:
            raise InputError(
                f"{path}: line {number}: unpacks to over {LARGEST_RATIO} times its size, which no"
                " log does; unpack it first if it is one"
            )
        # A truncated last line cannot be distinguished from a complete one.
        parts = [] if fault else (rest + block).split(b"\n")
        # The last part continues in the next block, unless this is the end.
        rest = parts.pop() if block else b""
        for text in parts:
            if long:
                yield LogLine(number, b"", f"longer than {BLOCK_BYTES} bytes")
            elif text:
                yield LogLine(number, text)
            number, long = number + 1, False
        if len(rest) > BLOCK_BYTES:
            rest, long = b"", True
        if not block:
            if fault:
                yield LogLine(number, b"", fault)
            return
