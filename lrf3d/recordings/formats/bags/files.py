"""The messages in files of ROS bags: MCAP, SQLite, and the .bag of ROS 1.

Files are read from the beginning, without their index, so that a truncated file (a killed recorder,
a full disk) is read up to its last complete record, also within a chunk.
"""

import bz2
import io
import re
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from lrf3d.base.errors import InputError, one_line, storage
from lrf3d.base.files import check_ordinary
from lrf3d.base.formats import MCAP, ROS_1, ROS_1_OLD, SQLITE, ZSTD, by_name
from lrf3d.messages.clouds import CLOUD

# Largest size [bytes] of a record: recorders write chunks of one megabyte, some of a hundred, so a
# larger length is damaged.
LARGEST_RECORD = 1 << 28

# Bytes that are unpacked at a time of a packed file: of a file that is cut, the last are lost.
BLOCK = 1 << 16


# What the packages of Livox' drivers begin with, whose clouds are packed in a way of their own.
LIVOX = "livox"


class BagTopic(NamedTuple):
    """A topic, the type of its messages, by its name in ROS 2, and how they are packed."""

    name: str
    kind: str
    packing: str

    @classmethod
    def of(cls, name: str, kind: str, packing: str) -> "BagTopic":
        """A topic from its name, which may lack the slash, and its type in ROS 1's or 2's form."""
        new = re.sub(r"^(\w+)/(\w+)$", r"\1/msg/\2", kind)
        if new.startswith(LIVOX) and new.endswith("/CustomMsg"):
            new = CLOUD
            packing = f"{LIVOX} {packing}"
        return cls("/" + name.removeprefix("/"), new, packing)


# A message: its topic, when it was received [ns], and its bytes; None announces a topic.
Packet = tuple[BagTopic, int, Any]


def bag_files(path: Path) -> list[Path]:
    """The files of a bag, in the order of their numbers."""
    if not path.is_dir():
        check_ordinary(path, what="a ROS bag")
        return [path]
    parts = sorted(part for part in path.iterdir() if not part.is_dir())
    for part in parts:
        check_ordinary(part, what="a file of a ROS bag")
    endings = by_name("log", "bag").endings
    for ending in endings:
        if files := [part for part in parts if ending in part.suffixes[-2:]]:
            return sorted(files, key=lambda file: (len(file.name), file.name))
    known = ", ".join(endings)
    there = one_line(", ".join(part.name for part in parts), 90)
    found = f" ({there})" if there else ""
    raise InputError(f"{path}: a folder without {known} or run.npz{found}, expected a log")


def packets(path: Path, note: Callable[[str], None]) -> Iterator[Packet]:
    """The messages of a file; raises InputError if it is not a bag, notes if it was cut short."""
    with ExitStack() as stack:
        file: Any = stack.enter_context(path.open("rb"))
        head = file.read(len(SQLITE))
        if head.startswith(ZSTD):
            file = stack.enter_context(tempfile.NamedTemporaryFile())
            _unpack(path, file)
            head = file.read(len(SQLITE))
        if head == SQLITE:
            try:
                yield from _of_sqlite(Path(file.name), note)
            except sqlite3.DatabaseError as error:
                raise InputError(f"{error}; sqlite3's .recover saves what is whole") from None
            return
        is_mcap = head.startswith(MCAP)
        if not is_mcap and not head.startswith((ROS_1, ROS_1_OLD)):
            raise InputError("none of a known kind" if head else "an empty file")
        end = file.seek(0, 2)
        if is_mcap:
            file.seek(max(end - len(MCAP), 0))
            whole = file.read() == MCAP
            file.seek(len(MCAP))
        else:
            file.seek(len(ROS_1))
            index = int.from_bytes(_fields(_block(file)).get(b"index_pos", b""), "little")
            whole = 0 < index <= end
            _block(file)
        if not whole:
            note(f"{path.name} was cut short: what is whole in it was read")
        yield from _of_mcap(file, {}, {}) if is_mcap else _of_ros1(file, {})


def unpacked(packing: str, data: bytes) -> bytes:
    """What packed data hold, as far as they are whole."""
    from lz4.frame import LZ4FrameDecompressor

    if packing in ("", "none"):
        return data
    kinds = {
        "zstd": _zstd().ZstdDecompressor,
        "lz4": LZ4FrameDecompressor,
        "bz2": bz2.BZ2Decompressor,
    }
    parts = []
    while data:
        unpacker = kinds[packing]()
        parts.append(unpacker.decompress(data))
        data = unpacker.unused_data or b"" if unpacker.eof else b""
    return b"".join(parts)


def _zstd() -> Any:
    """The module for packed data that rosbags brings, or Python from 3.14 on."""
    return import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")


def _check_size(size: int) -> None:
    if size > LARGEST_RECORD:
        raise InputError(f"a record of {storage(size)}; record in smaller chunks")


def _unpack(path: Path, whole: Any) -> None:
    with suppress(EOFError), _zstd().open(path) as stream:
        shutil.copyfileobj(stream, whole, BLOCK)
    if not whole.tell():
        raise InputError("cut short, so that nothing in it is whole")
    whole.seek(0)


def _of_sqlite(path: Path, note: Callable[[str], None]) -> Iterator[Packet]:
    # Nothing is written next to the file. The journal that a killed recorder left is read from
    # copies, since SQLite moves its content into the file.
    journal = path.with_name(f"{path.name}-wal")
    with ExitStack() as stack:
        uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
        if journal.is_file() and journal.stat().st_size:
            note(f"{path.name} was not closed: what is whole in {journal.name} was read, too")
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            for part in (path, journal):
                shutil.copyfile(part, folder / part.name)
            uri = (folder / path.name).as_uri()
        database = stack.enter_context(closing(sqlite3.connect(uri, uri=True)))
        names = "SELECT name FROM sqlite_master WHERE type = 'table'"
        if not {("topics",), ("messages",)} <= set(database.execute(names)):
            raise InputError("without tables of topics and messages")
        topics = {}
        columns = "id, name, type, serialization_format"
        for number, *words in database.execute(f"SELECT {columns} FROM topics"):
            topics[number] = BagTopic.of(*map(str, words))
            yield topics[number], 0, None
        # Messages keep the order of their rows: sorted by a clock that was set back, they would mix
        # two drives.
        rows = "SELECT topic_id, timestamp, data FROM messages ORDER BY rowid"
        for number, received, data in database.execute(rows):
            # Converters write no time, or one with a fraction.
            if isinstance(data, bytes):
                yield topics[number], int(received or 0), data


# What the records of MCAP hold, by their codes.
RECORDS = {3: "schema", 4: "channel", 5: "message", 6: "chunk", 15: "end"}


def _of_mcap(stream: Any, schemas: dict[int, str], topics: dict[int, BagTopic]) -> Iterator[Packet]:
    while len(head := stream.read(9)) == 9 and (kind := RECORDS.get(head[0])) != "end":
        size = int.from_bytes(head[1:], "little")
        if kind is None:
            stream.seek(size, 1)
            continue
        _check_size(size)
        data = stream.read(size)
        if kind == "chunk":
            packing, place = _text(data, 28)
            yield from _of_mcap(io.BytesIO(unpacked(packing, data[place + 8 :])), schemas, topics)
            continue
        if len(data) < size:
            continue
        own, other = (int.from_bytes(data[k : k + 2], "little") for k in (0, 2))
        if kind == "schema":
            schemas[own] = _text(data, 2)[0]
        elif kind == "channel":
            name, place = _text(data, 4)
            topics[own] = BagTopic.of(name, schemas.get(other, ""), _text(data, place)[0])
            yield topics[own], 0, None
        else:
            yield topics[own], int.from_bytes(data[6:14], "little"), data[22:]


def _text(data: bytes, place: int) -> tuple[str, int]:
    """A string in a record, and where it ends."""
    end = place + 4 + int.from_bytes(data[place : place + 4], "little")
    return data[place + 4 : end].decode("utf-8", "replace"), end


# What the records of ROS 1 hold, by their codes; recorders of 2010 wrote a wrong length of indices.
OLD_RECORDS = {2: "message", 4: "index", 5: "chunk", 7: "connection"}

# Size of an entry of such an index [bytes], by its version.
INDEX_ENTRY = {0: 16, 1: 12}


def _of_ros1(stream: Any, topics: dict[bytes, BagTopic]) -> Iterator[Packet]:
    while header := _block(stream):
        fields = _fields(header)
        kind = OLD_RECORDS.get(int.from_bytes(fields.get(b"op", b""), "little"))
        if kind == "chunk":
            inner = io.BytesIO(unpacked(fields[b"compression"].decode(), _block(stream)))
            yield from _of_ros1(inner, topics)
            continue
        if kind == "index":
            version, count = (int.from_bytes(fields[name], "little") for name in (b"ver", b"count"))
            stream.seek(4 + INDEX_ENTRY[version] * count, 1)
            continue
        data = _block(stream)
        if kind == "message" and b"conn" not in fields:
            # Version 1.2 names the topic in each message.
            topic = BagTopic.of(fields[b"topic"].decode(), fields[b"type"].decode(), "ros1")
            sec, nanosec = (int.from_bytes(fields[name], "little") for name in (b"sec", b"nsec"))
            yield topic, sec * 1_000_000_000 + nanosec, data
        elif kind == "connection":
            of_type = _fields(data)[b"type"].decode()
            name = fields[b"topic"].decode("utf-8", "replace")
            topics[fields[b"conn"]] = BagTopic.of(name, of_type, "ros1")
            yield topics[fields[b"conn"]], 0, None
        elif kind == "message":
            sec, nanosec = (int.from_bytes(fields[b"time"][k : k + 4], "little") for k in (0, 4))
            yield topics[fields[b"conn"]], sec * 1_000_000_000 + nanosec, data


def _block(stream: Any) -> bytes:
    """The bytes of a block, which begins with its length; fewer where the file is cut."""
    size = int.from_bytes(stream.read(4), "little")
    _check_size(size)
    data: bytes = stream.read(size)
    return data


def _fields(header: bytes) -> dict[bytes, bytes]:
    stream = io.BytesIO(header)
    fields = {}
    while each := _block(stream):
        name, _, fields[name] = each.partition(b"=")
    return fields
