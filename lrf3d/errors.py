"""The errors that lrf3d raises on purpose; each message is one line: what, where, how to mend.

The tree::

    Lrf3dError
    ├── InputError (ValueError)      a value, a file or a flag that cannot be used
    │   └── WorldError               a world file or a world that cannot be used
    ├── CollisionError               a drive that would run into a wall
    ├── OutputError (OSError)        a file or a folder that cannot be written
    └── MissingLibraryError          a library that this task needs and this machine lacks
"""

LONGEST = 600
"""Characters of a message at most: some lines of a terminal, whatever a file or a flag holds."""


def one_line(text: str, most: int = LONGEST) -> str:
    r"""A text as one line of a terminal: control characters escaped, the middle left out if long.

    What is written by strangers, such as the name of a file, moves no cursor and fakes no line.

    >>> one_line("a\nb"), one_line("abcdefghij", most=7)
    ('a\\nb', 'abc…hij')
    """
    if len(text) > most:
        text = f"{text[: most // 2]}…{text[len(text) - (most - 1) // 2 :]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object, most: int = 40) -> str:
    """A value that is not the program's own, as a message shows it: in few words.

    >>> shown("word"), shown(list(range(100)), most=15)
    ("'word'", '[0, 1, …98, 99]')
    """
    if isinstance(value, str) and len(value) > 2 * most:
        # What would be left out is not even escaped.
        value = value[:most] + value[-most:]
    try:
        return one_line(repr(value), most)
    except ValueError:
        # Python writes no integer of more than 4,300 digits.
        return f"a {type(value).__name__} of very many digits"


class Lrf3dError(Exception):
    """The root of all errors that lrf3d raises on purpose; the message is made one line."""

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


class MissingLibraryError(Lrf3dError):
    """A library that this task needs and this machine lacks."""
