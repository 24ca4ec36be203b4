"""The lines of keys in a TOML text, which tomllib does not report.

The text has been accepted by tomllib, so the scanner does not check it again. It finds the line of
every key and of every element of an array.
"""

import re

KeyPath = tuple[str | int, ...]
"""The path of a value: keys of tables and indices of arrays, ``("object", 2, "points", 0)``."""

_TOKEN = re.compile(
    r'''
      (?P<blank> [ \t\r]+ | \#[^\n]* )
    | (?P<text>  """(?:\\[\s\S]|[^\\])*?"""(?:"{0,2}) | \'\'\'[\s\S]*?\'\'\'(?:'{0,2})
               | "(?:\\.|[^"\\\n])*" | '[^'\n]*' )
    | (?P<mark>  [\[\]{}=,.\n] )
    | (?P<bare>  [^\s\[\]{}=,."'\#]+ )
    ''',
    re.VERBOSE,
)


def lines_of_keys(text: str) -> dict[KeyPath, int]:
    """Line, from 1, of each key and array element of a TOML text, by its path."""
    return _Scanner(text).scan()


def nearest_line(lines: dict[KeyPath, int], path: KeyPath) -> int:
    """Line of a path, or of the nearest part above it that has one; otherwise 1."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path, 1)


class _Scanner:
    """A pass over the tokens of a text that records the lines of keys and elements."""

    def __init__(self, text: str) -> None:
        self.tokens: list[tuple[str, int]] = []
        line = 1
        for match in _TOKEN.finditer(text):
            if match.lastgroup != "blank":
                self.tokens.append((match.group(), line))
            line += match.group().count("\n")
        self.tokens.append(("", line))
        self.position = 0
        self.lines: dict[KeyPath, int] = {}
        self.table_counts: dict[KeyPath, int] = {}

    def scan(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while self.text:
            if self.text == "\n":
                self.position += 1
            elif self.text == "[":
                table = self.header()
            else:
                self.pair(table)
        return self.lines

    @property
    def text(self) -> str:
        return self.tokens[self.position][0]

    @property
    def line(self) -> int:
        return self.tokens[self.position][1]

    def header(self) -> KeyPath:
        """Read ``[table]`` or ``[[array]]`` and return the path of the table it opens."""
        line = self.line
        self.position += 1
        repeated = self.text == "["
        self.position += repeated
        keys = self.keys("]")
        self.position += 1 + repeated
        *above, last = keys
        path: KeyPath = ()
        for key in above:
            path = (*path, key)
            if path in self.table_counts:
                path = (*path, self.table_counts[path] - 1)
        path = (*path, last)
        if repeated:
            index = self.table_counts.get(path, 0)
            self.table_counts[path] = index + 1
            self.lines.setdefault(path, line)
            path = (*path, index)
        self.lines[path] = line
        return path

    def keys(self, end: str) -> list[str]:
        """Read a dotted key up to a closing mark."""
        keys = []
        while self.text not in (end, ""):
            if self.text != ".":
                keys.append(self.text.strip("\"'"))
            self.position += 1
        return keys

    def pair(self, table: KeyPath) -> None:
        """Read ``key = value``."""
        line = self.line
        path = (*table, *self.keys("="))
        for depth in range(len(table) + 1, len(path) + 1):
            self.lines.setdefault(path[:depth], line)
        self.position += 1
        self.value(path)

    def value(self, path: KeyPath) -> None:
        """Read a value: an array, an inline table, or anything up to the next mark."""
        if self.text in ("[", "{"):
            end = "]" if self.text == "[" else "}"
            self.position += 1
            index = 0
            while self.text not in (end, ""):
                if self.text in (",", "\n"):
                    self.position += 1
                elif end == "}":
                    self.pair(path)
                else:
                    self.lines[(*path, index)] = self.line
                    self.value((*path, index))
                    index += 1
            self.position += 1
        else:
            while self.text not in (",", "]", "}", "\n", ""):
                self.position += 1
