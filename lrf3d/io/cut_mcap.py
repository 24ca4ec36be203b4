"""A .mcap file whose end is missing, as a killed recorder or a full disk leaves it, made readable.

Its records, up to the last whole one, are copied to a temporary file that ends without an index. Of
a chunk that is cut, the records that unpack are copied.
"""

import io
import shutil
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from lrf3d.files import scratch_folder

MAGIC = b"\x89MCAP0\r\n"
END = b"\x02" + (20).to_bytes(8, "little") + bytes(20) + MAGIC
"""The footer of a file without a summary."""

CHUNK, DATA_END = 0x06, 0x0F
"""Kinds of records: one that holds others, packed, and the one after the last of the data."""

CHUNK_HEAD = 28
"""Bytes of a chunk before the name of its compression."""

LARGEST_CHUNK = 1 << 28
"""Most bytes that a chunk which was cut is unpacked to."""


def whole_part(path: Path, stack: ExitStack) -> Path | None:
    """A copy of what is whole in a file, for as long as the stack; None if it is no such file."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return None
        end = _whole_records(file)
        file.seek(end)
        rest = _unpacked(file) if file.read(1) == bytes([CHUNK]) else b""
        whole = stack.enter_context(scratch_folder()) / path.name
        with whole.open("wb") as copy:
            file.seek(0)
            copy.write(file.read(len(MAGIC)))
            shutil.copyfileobj(file, copy)
            copy.truncate(end)
            copy.seek(end)
            copy.write(rest[: _whole_records(io.BytesIO(rest))] + END)
        return whole


def _whole_records(file: Any) -> int:
    """Where the last whole record ends that begins at the file's position."""
    end, size = file.tell(), file.seek(0, io.SEEK_END)
    while end + 9 <= size:
        file.seek(end)
        head = file.read(9)
        following = end + 9 + int.from_bytes(head[1:], "little")
        if head[0] == DATA_END or following > size:
            break
        end = following
    return int(end)


def _unpacked(file: Any) -> bytes:
    """The records of a chunk that is cut, as far as they unpack."""
    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag2 import storage_mcap

    head = file.read(8 + CHUNK_HEAD + 4)
    name = file.read(int.from_bytes(head[-4:], "little") % 16)
    file.read(8)
    packed = file.read(LARGEST_CHUNK)
    with suppress(Exception):
        # Damaged data may raise any exception.
        if name == b"zstd":
            # Which module it is depends on the version of Python.
            zstd: Any = vars(storage_mcap)["zstd"]
            return bytes(zstd.ZstdDecompressor().decompress(packed, LARGEST_CHUNK))
        if name == b"lz4":
            return bytes(LZ4FrameDecompressor().decompress(packed, LARGEST_CHUNK))
        return b"" if name else bytes(packed)
    return b""
