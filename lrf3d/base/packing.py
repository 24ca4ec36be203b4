"""Values as JSON and arrays: how one process sends them to another, without pickling.

A value is written to a stream as 16 bytes of sizes, a text of JSON, and the bytes of its arrays.
The text names records: dataclasses and NamedTuples of lrf3d's packages of values. The receiver
rebuilds each by its constructor, which validates it. A writer that an attacker controls can send a
wrong value, but no code.
"""

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import IO, Any

from lrf3d.base.errors import storage

# Each array begins at a multiple of this [bytes], so that it is used without a copy.
ALIGNED = 8

# Shortest list of floats that is written as an array; JSON is as small for shorter ones.
MANY = 16

# Packages, and the modules of balances and notes, whose records may be sent.
ROOMS = re.compile(r"lrf3d\.(base\.(balance|text)|(geometry|laser|plans|recordings|world)(\.\w+)+)")

# Types that JSON keeps as they are.
PLAIN = (bool, int, float, str, type(None))


def send(stream: IO[bytes], value: Any) -> None:
    """Write a value; raises TypeError if it holds something that cannot be sent."""
    packer = _Packer()
    tree = packer.packed(value)
    text = json.dumps([tree, [[each.dtype.str, *each.shape] for each in packer.arrays]]).encode()
    size = sum(_filled(each.nbytes) for each in packer.arrays)
    stream.write(len(text).to_bytes(8, "little") + size.to_bytes(8, "little") + text)
    for each in packer.arrays:
        stream.write(each.tobytes() + bytes(_filled(each.nbytes) - each.nbytes))
    stream.flush()


def receive(stream: IO[bytes], most: int) -> Any:
    """Read a value of at most this size [bytes]; its arrays are read-only.

    Raises:
        EOFError: The stream ended before the value did.
        ValueError: The value is too large, or was not written by `send`.
    """
    text_size, size = (int.from_bytes(_read(stream, 8), "little") for _ in range(2))
    # Parsed, a text takes several times its size.
    if 4 * text_size + size > most:
        raise ValueError(storage(text_size + size))
    text = _read(stream, text_size)
    data = _read(stream, size)
    try:
        tree, shapes = json.loads(text)
        return _value(tree, list(_arrays(shapes, data)))
    except (AttributeError, ImportError, LookupError, RecursionError, TypeError) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None


def _filled(size: int) -> int:
    """A size [bytes], rounded up to where the next array may begin."""
    return -(-size // ALIGNED) * ALIGNED


def _read(stream: IO[bytes], size: int) -> bytearray:
    """Read a number of bytes of a stream."""
    data = bytearray(size)
    view = memoryview(data)
    place = 0
    while place < size:
        count = stream.readinto(view[place:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        place += count
    return data


def _arrays(shapes: list[Any], data: bytearray) -> Iterator[Any]:
    """The arrays that bytes hold, by their types and shapes."""
    import numpy as np

    place = 0
    for kind, *shape in shapes:
        dtype = np.dtype(kind)
        if dtype.kind not in "biuf":
            raise ValueError(f"an array of {dtype}")
        count = int(np.prod(shape, dtype=object))
        array = np.frombuffer(data, dtype, count, place) if count else np.empty(0, dtype)
        array.flags.writeable = False
        yield array.reshape(shape)
        place += _filled(array.nbytes)


def _names(kind: type) -> Sequence[str]:
    """The names of a record's fields; none if the class is no record."""
    if is_dataclass(kind):
        return [each.name for each in fields(kind)]
    return getattr(kind, "_fields", ())


class _Packer:
    """Converts a value to a tree of JSON, and collects its arrays, each once."""

    def __init__(self) -> None:
        self.arrays: list[Any] = []
        self._places: dict[int, int] = {}

    def packed(self, value: Any) -> Any:
        """The tree of a value: itself where it is plain, or a list that begins with its kind."""
        kind = type(value)
        if kind in PLAIN:
            return value
        if kind in (list, tuple):
            return [kind.__name__, *self._many(list(value))]
        if kind in (dict, Counter):
            return [kind.__name__, self._many(list(value)), self._many(list(value.values()))]
        if hasattr(value, "dtype") and value.dtype.kind == "O":
            return ["objects", *self._many(value.tolist())]
        if hasattr(value, "dtype"):
            return ["array", self._array(value)] if hasattr(value, "setflags") else value.item()
        name = self._record(kind)
        return ["record", name, [self.packed(getattr(value, each)) for each in _names(kind)]]

    def _many(self, values: list[Any]) -> list[Any]:
        """The trees of several values; those of one class by columns, which is fast for many."""
        kinds = {type(each) for each in values}
        kind = kinds.pop() if len(kinds) == 1 else None
        count = len(values)
        if count > 1 and all(each is values[0] for each in values):
            return ["same", count, self.packed(values[0])]
        if kind is float and count >= MANY:
            import numpy as np

            return ["floats", self._array(np.array(values))]
        if kind is not None and count > 1 and hasattr(values[0], "setflags"):
            return self._stack(values)
        if kind is not None and count > 1 and _names(kind):
            columns = [[getattr(each, name) for each in values] for name in _names(kind)]
            return ["rows", self._record(kind), [self._many(column) for column in columns]]
        return ["each", *map(self.packed, values)]

    def _stack(self, values: list[Any]) -> list[Any]:
        """Arrays; those of one type and shape as an array of distinct ones, and indices into it."""
        import numpy as np

        different = {id(each): each for each in values}
        alike = len({(each.dtype, each.shape) for each in different.values()}) == 1
        if not alike or values[0].dtype.kind == "O":
            return ["each", *map(self.packed, values)]
        stacked = np.array(list(different.values()))
        if (stacked == stacked[0]).all():
            return ["same", len(values), self.packed(values[0])]
        places = {key: place for place, key in enumerate(different)}
        rows = np.array([places[id(each)] for each in values])
        return ["stack", self._array(stacked), self._array(rows)]

    def _array(self, array: Any) -> int:
        """The number of an array among those that are sent."""
        if id(array) not in self._places:
            self._places[id(array)] = len(self.arrays)
            # Kept alive, so that no other array gets its identity.
            self.arrays.append(array)
        return self._places[id(array)]

    def _record(self, kind: type) -> str:
        if not (_names(kind) and ROOMS.fullmatch(kind.__module__)):
            raise TypeError(f"{kind.__name__}: not handed to another process")
        return f"{kind.__module__}:{kind.__qualname__}"


def _value(tree: Any, arrays: list[Any]) -> Any:
    """The value of a tree."""
    if not isinstance(tree, list):
        return tree
    kind, *rest = tree
    if kind == "array":
        return arrays[rest[0]]
    if kind == "list":
        return _values(rest, arrays)
    if kind == "objects":
        import numpy as np

        return np.array(_values(rest, arrays), dtype=object)
    if kind == "tuple":
        return tuple(_values(rest, arrays))
    if kind in ("dict", "Counter"):
        keys, values = (_values(each, arrays) for each in rest)
        found = dict(zip(keys, values, strict=True))
        return found if kind == "dict" else Counter(found)
    if kind != "record":
        raise ValueError(f"a value of kind {kind!r}")
    name, values = rest
    return _maker(name)([_value(each, arrays) for each in values])


def _values(many: list[Any], arrays: list[Any]) -> list[Any]:
    """The values of several trees."""
    kind, *rest = many
    if kind == "same":
        return [_value(rest[1], arrays)] * rest[0]
    if kind == "floats":
        return list(arrays[rest[0]].tolist())
    if kind == "stack":
        each = list(arrays[rest[0]])
        return [each[place] for place in arrays[rest[1]].tolist()]
    if kind == "rows":
        columns = [_values(column, arrays) for column in rest[1]]
        return list(map(_maker(rest[0]), zip(*columns, strict=True)))
    return [_value(each, arrays) for each in rest]


def _maker(name: str) -> Any:
    """The constructor of a record, by its name."""
    module, _, kind_name = name.partition(":")
    if not ROOMS.fullmatch(module):
        raise ValueError(f"a record of {module}")
    kind = getattr(import_module(module), kind_name)
    names = _names(kind)
    if not (names and isinstance(kind, type) and kind.__module__ == module):
        raise ValueError(f"{kind_name} is no record")
    return lambda values: kind(**dict(zip(names, values, strict=True)))
