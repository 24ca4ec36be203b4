"""The errors that lrf3d raises on purpose; each message is one line: what, where, how to fix it.

The tree::

    Lrf3dError
    ├── InputError (ValueError)      a value, a file or a flag that cannot be used
    │   └── WorldError               a world file or a world that cannot be used
    ├── CollisionError               a drive that would run into a wall
    ├── OutputError (OSError)        a file or a folder that cannot be written
    ├── DrawingError                 a picture or a film that failed; the data are written
    └── MissingLibraryError          a library that this task needs and this machine lacks
"""

import operator
import sys
from pathlib import Path

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from typing import Any

# Largest number of characters of a message: some lines of a terminal.
LONGEST_MESSAGE = 600


def one_line(text: str, most: int = LONGEST_MESSAGE) -> str:
    r"""A text as one line of a terminal: control characters escaped, the middle left out if long.

    Untrusted text, such as the name of a file, can then neither move the cursor nor fake a line.

    >>> one_line("a\nb"), one_line("abcdefghij", most=7)
    ('a\\nb', 'abc…hij')
    """
    if len(text) > most:
        text = f"{text[: most // 2]}…{text[len(text) - (most - 1) // 2 :]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object, most: int = 40) -> str:
    """A short form of a value that a user gave, for a message.

    >>> shown("word"), shown(list(range(100)), most=15)
    ("'word'", '[0, 1, …98, 99]')
    """
    if isinstance(value, str) and len(value) > 2 * most:
        # Only the part that is shown is escaped.
        value = value[:most] + value[-most:]
    try:
        return one_line(_text(value), most)
    except ValueError:
        # Python does not convert numbers of more than 4,300 digits.
        return "a number of thousands of digits"
    except Exception:
        # It is nested too deeply, or of a class whose text is an error.
        return f"a value of type {type(value).__name__}"


def storage(size: float) -> str:
    """A size [bytes] in words.

    >>> storage(1_234_567), storage(800)
    ('1.2 MB', '0.8 kB')
    """
    for unit in ("kB", "MB"):
        size /= 1000
        if size < 1000:
            return f"{size:.1f} {unit}"
    return f"{size / 1000:,.1f} GB"


def _text(value: object) -> str:
    """The text of a value, or of its first parts if it has thousands: they may be all the same."""
    parts = [value]
    count = 0
    most_parts = 10_000  # Largest number of parts of a value that is shown by all of them.
    while parts and count < most_parts:
        part = parts.pop()
        count += 1
        parts += part if isinstance(part, list | tuple) else ()
        parts += part.values() if isinstance(part, dict) else ()
    if not parts:
        return repr(value)
    from reprlib import repr as short_repr

    return short_repr(value)


class Lrf3dError(Exception):
    """The root of all errors that lrf3d raises on purpose; the message is one line.

    Examples:
        >>> import lrf3d
        >>> try:
        ...     lrf3d.load_world("citty")
        ... except lrf3d.Lrf3dError as error:
        ...     print(type(error).__name__)
        WorldError
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


class InputError(Lrf3dError, ValueError):
    """A value, a file or a flag that cannot be used."""


class WorldError(InputError):
    """A world file, or the segments of a world, that cannot be used."""


class CollisionError(Lrf3dError):
    """A drive that would run into a wall."""


class OutputError(Lrf3dError, OSError):
    """A file or a folder that cannot be written."""


class Lrf3dWarning(UserWarning):
    """A note: something is done differently than usual, with the results that were requested.

    The text also goes to the logger ``lrf3d``, for programs that have set up logging.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(message)
        import logging

        logger = logging.getLogger("lrf3d")
        if not logger.handlers:
            logger.addHandler(logging.NullHandler())
        logger.log(self.level, "%s", message)

    # That of the logger: logging.WARNING.
    level = 30


class Lrf3dNote(Lrf3dWarning):
    """What was assumed, or left out, in reading a file."""

    # That of the logger: logging.INFO.
    level = 20


class DrawingError(Lrf3dError):
    """A picture or a film that could not be drawn after the data were written."""


class MissingLibraryError(Lrf3dError):
    """A library that this task needs and this machine lacks."""


def check_names(place: str, given: "Iterable[str]", known: "Iterable[str]") -> None:
    """Check that names are known; for one that is not, the nearest known one, or all, are named."""
    known = list(known)
    plain = {name.lstrip("-").lower(): name for name in known}
    for name in given:
        if not isinstance(name, str) or name not in known:
            from difflib import get_close_matches

            word = name.lstrip("-").lower() if isinstance(name, str) else ""
            near = get_close_matches("rng" if word == "seed" else word, plain, n=1, cutoff=0.5)
            hint = f"did you mean {plain[near[0]]!r}?" if near else f"known are {', '.join(known)}"
            raise InputError(f"{place}: there is no {shown(name)}; {hint}")


def missing_extra(task: str, extra: str) -> MissingLibraryError:
    """The error of a task whose extra is not installed, with the command that installs it here.

    Package indexes may not have what a checkout is; the checkout itself always installs.
    """
    checkout = Path(__file__).parents[2]
    command = f"pip install 'lrf3d[{extra}]'"
    if (checkout / "pyproject.toml").exists():
        command = f"{sys.executable} -m pip install -e '{checkout}[{extra}]'"
    return MissingLibraryError(f"{task}; install it: {command}")


def expect(value: object, kind: "Any", name: str) -> None:
    """Check the kind of an argument that comes from outside."""
    if not isinstance(value, kind):
        names = " or ".join(each.__name__ for each in getattr(kind, "__args__", (kind,)))
        expected = names.replace("NoneType", "None")
        article = "an" if expected[0] in "AEIOU" else "a"
        raise InputError(f"{name} {shown(value)}: expected {article} {expected}")


def index_of(value: object, count: int, name: str) -> int:
    """Check an index from a user: it counts from 0, or backwards from −1."""
    try:
        place = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        place = count
    if isinstance(value, bool) or not -count <= place < count:
        raise InputError(f"{name} {shown(value)}: expected a whole number from 0 to {count - 1}")
    return place


def each_of(values: "Any", kind: type, name: str) -> "Iterator[Any]":
    """Yield the values of an argument that comes from outside, each checked to be of a kind."""
    try:
        found = iter([values] if isinstance(values, str) else values)
    except TypeError:
        raise InputError(f"{name} {shown(values)}: expected a list of {kind.__name__}") from None
    for each in found:
        expect(each, kind, name)
        yield each
