"""H.264 films: written frame by frame, and parts of one joined without encoding again.

What is to become a film of another kind is kept without loss in the meantime.
"""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, cast

import av

from lrf3d.render.pictures import Picture

_RATES = 1000
"""Frames a second are kept as a fraction of this denominator at most."""

_OPTIONS = {
    # A short look ahead halves the size that this preset gives, at a fifth less time than the next.
    "preset": "superfast",
    "x264-params": "rc-lookahead=8:mbtree=1",
    "crf": "20",
    # Frames made from later ones have times out of order, which parts could not be joined with.
    "bf": "0",
}


_LOSSLESS = {"preset": "ultrafast", "qp": "0", "bf": "0"}


class Encoder:
    """Writes RGBA pictures to an mp4 file.

    Args:
        path: The file.
        size: Width and height of the pictures [pixels], both even.
        fps: Frames a second.
        first: The number of the first picture in the film; an mp4's parts are alike.
    """

    FORMAT: ClassVar = "mp4"
    CODEC: ClassVar = "libx264"
    COLOURS: ClassVar = "yuv420p"
    OPTIONS: ClassVar[dict[str, str]] = _OPTIONS

    def __init__(self, path: Path, *, size: tuple[int, int], fps: float, first: int = 0) -> None:
        self._container = av.open(str(path), "w", format=self.FORMAT)
        rate = Fraction(fps).limit_denominator(_RATES)
        stream = self._container.add_stream(self.CODEC, rate, options=self.OPTIONS)
        self._stream = cast(av.VideoStream, stream)
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = self.COLOURS
        self._stream.codec_context.time_base = 1 / rate
        # Each process has one encoder, and there are as many as there are cores.
        self._stream.codec_context.thread_count = 1
        self._fps, self._first, self._frames = fps, first, 0

    def _time(self) -> int:
        """When the next frame begins, in units of the stream's time base."""
        return self._frames

    def add(self, picture: Picture) -> None:
        """Write a picture (h, w, 4) uint8."""
        frame = av.VideoFrame.from_ndarray(picture, format="rgba")
        frame.pts = self._time()
        frame.time_base = self._stream.codec_context.time_base
        self._frames += 1
        self._container.mux(self._stream.encode(frame))

    def __enter__(self) -> "Encoder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._container.mux(self._stream.encode(None))
        self._container.close()


class LosslessEncoder(Encoder):
    """Writes RGBA pictures of any size to an mp4 file so that they come back as they were."""

    CODEC = "libx264rgb"
    COLOURS = "rgb24"
    OPTIONS = _LOSSLESS


def join(parts: Sequence[Path], frames: Sequence[int], path: Path) -> None:
    """Join the parts of a film, as many frames long as said, into one mp4 file."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as film:
        stream: Any = None
        done = 0
        for part, count in zip(parts, frames, strict=True):
            with av.open(str(part)) as container:
                source = container.streams.video[0]
                if stream is None:
                    stream = film.add_stream_from_template(source)
                assert source.average_rate is not None and source.time_base is not None
                step = 1 / (source.average_rate * source.time_base)
                start = int(done * step)
                for packet in container.demux(source):
                    if packet.dts is None or packet.pts is None:
                        continue
                    packet.pts += start
                    packet.dts += start
                    packet.stream = stream
                    film.mux(packet)
            done += count
