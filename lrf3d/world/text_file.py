"""Reading the text of a world file, with one clear line where that fails."""

from pathlib import Path

from lrf3d.errors import WorldError


def read_text(path: Path) -> str:
    """The text of a file, UTF-8 with or without a byte order mark.

    Raises:
        WorldError: There is no such file, or it cannot be read as text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise WorldError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise WorldError(f"{path}:{line}: not a text file in UTF-8") from None
    except OSError as error:
        raise WorldError(f"{path}: cannot be read: {error.strerror}") from None
