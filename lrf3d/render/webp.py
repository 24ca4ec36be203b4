"""Animated WebP: parts, each encoded by its own process, joined without encoding again."""

import struct
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

from lrf3d.render.mp4 import Encoder

FASTEST = 200.0
"""Most frames a second: browsers show what lasts 10 ms or less for a tenth of a second instead."""

_OPTIONS = {
    # A quarter of what the film takes as GIF, and hardly different from the original.
    "quality": "75",
    # The encoder's middle effort: twice as slow as 2 for a twentieth less, as fast as drawing.
    "compression_level": "4",
}

_MILLISECOND = Fraction(1, 1000)

_ANIMATED = 0x02
"""The flag of a file that moves; no other is set: all pixels are opaque."""

_LOSSY = b"VP8 "
"""The name of a picture's data within a frame, or alone in a file that does not move."""

_DURATION = 12
"""Where in a frame its duration stands: three bytes, little end first."""


def milliseconds(frame: int, fps: float) -> int:
    """When a frame begins [ms], so that rounding does not add up."""
    return round(frame * 1000 / fps)


class WebpEncoder(Encoder):
    """Writes RGBA pictures as a part of an animated WebP.

    Args:
        path: The file.
        size: Width and height of the pictures [pixels].
        fps: Frames a second.
        first: The number of the first picture in the film.
    """

    FORMAT = "webp"
    CODEC = "libwebp_anim"
    OPTIONS = _OPTIONS

    def __init__(self, path: Path, *, size: tuple[int, int], fps: float, first: int = 0) -> None:
        super().__init__(path, size=size, fps=fps, first=first)
        self._stream.codec_context.time_base = _MILLISECOND

    def _time(self) -> int:
        number = self._first + self._frames
        return milliseconds(number, self._fps) - milliseconds(self._first, self._fps)


def join_webp(parts: Sequence[Path], frames: Sequence[int], path: Path, *, fps: float) -> None:
    """Join parts, as many frames long as said, into one film that plays without end."""
    shown: list[bytes] = []
    done = 0
    for part, count in zip(parts, frames, strict=True):
        found = _shown_frames(part)
        # The encoder shows equal pictures as one; how long the last is shown, it cannot know.
        whole = milliseconds(done + count, fps) - milliseconds(done, fps)
        rest = whole - sum(_duration(frame) for frame in found[:-1])
        found[-1][_DURATION : _DURATION + 3] = rest.to_bytes(3, "little")
        shown += [bytes(frame) for frame in found]
        done += count
    # The first frame covers all.
    width, height = _size(shown[0])
    canvas = (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    body = b"WEBP" + _chunk(b"VP8X", struct.pack("<I", _ANIMATED) + canvas)
    # White behind the pictures, and no end.
    body += _chunk(b"ANIM", struct.pack("<IH", 0xFFFFFFFF, 0))
    body += b"".join(_chunk(b"ANMF", frame) for frame in shown)
    path.write_bytes(_chunk(b"RIFF", body))


def _duration(frame: bytes | bytearray) -> int:
    return int.from_bytes(frame[_DURATION : _DURATION + 3], "little")


def _shown_frames(part: Path) -> list[bytearray]:
    """The contents of the frames of a part; one that never changes is a still picture."""
    chunks = list(_chunks(part.read_bytes()))
    frames = [bytearray(data) for name, data in chunks if name == b"ANMF"]
    if frames:
        return frames
    picture = next(data for name, data in chunks if name == _LOSSY)
    # The size stands behind the frame's tag and start code, two bits of each for a scale.
    sides = (side & 0x3FFF for side in struct.unpack_from("<HH", picture, 6))
    place = bytes(6) + b"".join((side - 1).to_bytes(3, "little") for side in sides)
    return [bytearray(place + bytes(4) + _chunk(_LOSSY, picture))]


def _size(frame: bytes | bytearray) -> tuple[int, int]:
    """Width and height of a frame [pixels]."""
    return 1 + int.from_bytes(frame[6:9], "little"), 1 + int.from_bytes(frame[9:12], "little")


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and contents of the chunks of a RIFF file."""
    at = 12
    while at + 8 <= len(data):
        name, length = struct.unpack_from("<4sI", data, at)
        yield name, data[at + 8 : at + 8 + length]
        at += 8 + length + length % 2


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)
