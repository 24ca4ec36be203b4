"""The kinds of films by the ending of their file: how parts are encoded, and how joined."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol

from lrf3d.errors import InputError
from lrf3d.render import gif, mp4, webp
from lrf3d.render.pictures import FrameProgress, Picture


class PartEncoder(Protocol):
    """Writes the pictures of a part of a film, between entering and leaving it."""

    def add(self, picture: Picture) -> None:
        """Write a picture (h, w, 4) uint8."""
        ...

    def __enter__(self) -> "PartEncoder": ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


class Join(Protocol):
    """Makes a film of its parts, as many frames long as said."""

    def __call__(
        self,
        parts: Sequence[Path],
        frames: Sequence[int],
        path: Path,
        *,
        fps: float,
        progress: FrameProgress | None,
    ) -> None:
        """Make it; where that takes long, say how many of how many steps are done."""
        ...


@dataclass(frozen=True, slots=True)
class FilmFormat:
    """A kind of film.

    Args:
        part: Makes the encoder of a part, from its path, the size of the pictures, the frames a
            second and the number of the first frame.
        join: Makes a film of parts.
        fastest: Most frames a second that players show.
        even: Whether width and height have to be even.
        joining: About which share of the time joining takes, for progress.
    """

    part: Callable[..., PartEncoder]
    join: Join
    fastest: float
    even: bool
    joining: float = 0.0


def _join_mp4(
    parts: Sequence[Path],
    frames: Sequence[int],
    path: Path,
    *,
    fps: float,
    progress: FrameProgress | None,
) -> None:
    mp4.join(parts, frames, path)


def _join_webp(
    parts: Sequence[Path],
    frames: Sequence[int],
    path: Path,
    *,
    fps: float,
    progress: FrameProgress | None,
) -> None:
    webp.join_webp(parts, frames, path, fps=fps)


FORMATS: dict[str, FilmFormat] = {
    ".gif": FilmFormat(mp4.LosslessEncoder, gif.join_gif, gif.FASTEST, even=False, joining=0.4),
    ".mp4": FilmFormat(mp4.Encoder, _join_mp4, 1000.0, even=True),
    ".webp": FilmFormat(webp.WebpEncoder, _join_webp, webp.FASTEST, even=False),
}


def format_of(path: Path) -> FilmFormat:
    """The kind of film that a path names.

    Raises:
        InputError: There is no format with that ending.
    """
    found = FORMATS.get(path.suffix.lower())
    if found is None:
        raise InputError(f"{path}: expected a film that ends in {', '.join(sorted(FORMATS))}")
    return found
