"""Lines of a file, packed with gzip or not, within bounds of memory and time."""

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from lrf3d.errors import InputError
from lrf3d.input import opened

BLOCK_BYTES = 1 << 20
"""Bytes that are read at a time, and the longest line: a scan of 100,000 beams is shorter."""

LARGEST_RATIO = 100
"""How many times its packed size a file may unpack to: recorded scans come to 5 times, those of
a robot that stands still to some tens, a bomb of zeros to 1,000."""

SMALL_LOG = 1 << 23
"""Bytes that any file may unpack to, however small: they take no time worth speaking of."""

GZIP = b"\x1f\x8b"
"""How packed files begin; the name of a file may say otherwise."""


class LogLine(NamedTuple):
    """A line of a file: its number from 1, its bytes, and what is wrong with it, if anything."""

    number: int
    text: bytes
    fault: str = ""


def lines_of(path: Path) -> Iterator[LogLine]:
    """Go through the lines of a file that are not empty, holding a block of it at a time.

    A line that is too long comes without its text, but with a fault; where packed data are
    damaged or break off, a last line says so.

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
        # A line that breaks off with the data looks the same as that.
        parts = [] if fault else (rest + block).split(b"\n")
        # The last part goes on in the next block, unless this was the end.
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
