"""Small files that would hang, crash or fill the memory end in a value or in one line.

A number enters; a bomb leaves, always the same: kinds by turns, with random sizes.
``LRF3D_BOMBS=300`` tries three hundred, and prints the time and the memory of each with ``-s``.
"""

import gzip
import io
import json
import os
import random
import sqlite3
import struct
import subprocess
import sys
import zipfile
import zlib

import damaged_worlds
import pytest

from lrf3d.base import isolation

pytest.importorskip("resource")

COUNT = int(os.environ.get("LRF3D_BOMBS", "20"))

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm" stroke="black">{}</svg>'


def svg_uses(rng):
    uses = '<use href="#g{}" x="1"/>' * rng.randint(2, 40)
    count = rng.randint(5, 60)
    groups = [f'<g id="g{n}">{uses.replace("{}", str(n - 1))}</g>' for n in range(1, count)]
    return SVG.format(
        f'<g id="g0"><path d="M0 0L1 1"/></g>{"".join(groups)}<use href="#g{count - 1}"/>'
    )


def svg_clips(rng):
    count = rng.randint(5, 200)
    clips = [
        f'<clipPath id="c{n}" clip-path="url(#c{n - 1})"><rect width="{n}" height="9" '
        f'clip-path="url(#c{n - 1})"/></clipPath>'
        for n in range(1, count)
    ]
    return SVG.format("".join(clips) + f'<path d="M0 0L9 9" clip-path="url(#c{count - 1})"/>')


def svg_zigzag(rng):
    turns = " ".join(
        f"L {rng.random():.3f} {rng.random():.3f}" for _ in range(rng.randint(9, 9999))
    )
    return SVG.format(
        f'<path d="M 0 0 {turns} z" fill="black" fill-rule="{rng.choice(("evenodd", "nonzero"))}"/>'
    )


def svg_entities(rng):
    count = rng.randint(5, 30)
    names = "".join(
        f'<!ENTITY e{n} "{f"&e{n - 1};" * rng.randint(2, 20)}">' for n in range(1, count)
    )
    return (
        f'<!DOCTYPE svg [<!ENTITY e0 "M0 0">{names}]>{SVG.format(f"<text>&e{count - 1};</text>")}'
    )


def svg_deep(rng):
    count = rng.randint(100, 100_000)
    return SVG.format("<g>" * count + '<path d="M0 0L1 1"/>' + "</g>" * count)


def dxf_arrays(rng):
    columns = rng.choice((10, 1000, 30_000))
    insert = "0\nINSERT\n8\n0\n2\n{}\n10\n0\n20\n0\n70\n{}\n71\n{}\n44\n1\n45\n1\n"
    blocks = [
        f"0\nBLOCK\n2\nB{n}\n10\n0\n20\n0\n"
        + (
            insert.format(f"B{n - 1}", columns, columns)
            if n
            else "0\nLINE\n8\n0\n10\n0\n20\n0\n11\n1\n21\n1\n"
        )
        + "0\nENDBLK\n"
        for n in range(rng.randint(1, 9))
    ]
    return damaged_worlds.dxf(
        insert.format(f"B{len(blocks) - 1}", columns, columns), blocks="".join(blocks)
    )


def geojson_deep(rng):
    count = rng.randint(100, 200_000)
    opened, closed = rng.choice(("[]", ('{"a":', "}")))
    return f'{{"type": "Polygon", "coordinates": {opened * count}1{closed * count}}}'


def geojson_stars(rng):
    points = [[rng.random(), rng.random()] for _ in range(rng.randint(100, 5000))]
    rings = [[*points, points[0]]] * rng.randint(1, 3)
    return f'{{"type": "MultiPolygon", "units": "m", "coordinates": {[[each] for each in rings]}}}'


def geojson_stack(rng):
    squares = [
        [[[x, x], [x + 9, x], [x + 9, x + 9], [x, x + 9], [x, x]]]
        for x in (1e-3 * n for n in range(rng.randint(100, 4000)))
    ]
    return f'{{"type": "MultiPolygon", "units": "m", "coordinates": {squares}}}'


def toml_keys(rng):
    part = rng.choice(("a", '"a."', "1", "[a"))
    return ".".join([part] * rng.randint(100, 100_000)) + rng.choice((" = 1", "]", ""))


def yaml_aliases(rng):
    lines = ["a0: &a0 [1, 1]"]
    for n in range(1, rng.randint(3, 30)):
        lines.append(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * rng.randint(2, 12))}]")
    return "\n".join([*lines, "image: a.png", f"origin: *a{len(lines) - 1}", "resolution: 1"])


def gltf_accessors(rng):
    count = rng.choice((10**6, 10**8, 10**10))
    mesh = '"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}]'
    return (
        f'{{"asset":{{"version":"2.0"}},{mesh},"scenes":[{{"nodes":[0]}}],"accessors":'
        f'[{{"componentType":5126,"type":"VEC3","count":{count}}}]}}'
    )


def png_large(rng):
    wide, high = rng.choice((4000, 9000, 60_000)), rng.choice((4000, 9000, 60_000))
    row = b"\0" + bytes([rng.choice((0, 0x55, 0xFF))]) * (wide // 8)
    head = struct.pack(">IIBBBBB", wide, high, 1, 0, 0, 0, 0)
    data = zlib.compress(row * min(high, 10_000), 9)
    chunks = [(b"IHDR", head), (b"IDAT", data), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(each)) + name + each + struct.pack(">I", zlib.crc32(name + each))
        for name, each in chunks
    )


def log_lines(rng):
    line = rng.choice((b"\n", b"ODOM 0 0 0 0 0 0 1.0 h 1.0\n", b"FLASER 2 1 1 0 0 0 0 0 0 0\n"))
    return gzip.compress(line * rng.randint(10**5, 10**7))


def text_of_one_character(rng):
    word = rng.choice((" ", ",", "a", "[", "-", "1,", "'", "#", "\t", "r1,", '{"a":', "- "))
    return word * rng.randint(100, 300_000) + rng.choice(("", "\n1,2,3\n", "\n"))


def npz_large(rng):
    shape = rng.choice(((10**5, 10**5), (10**9,), (10**4, 1081)))
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("ranges.npy", array + bytes(rng.choice((10, 10**7, 10**8))))
    return out.getvalue()


def mcap_chunks(rng):
    zstd = pytest.importorskip("backports.zstd")
    data = bytes(rng.choice((10**6, 10**8, 10**9)))
    for _ in range(rng.randint(1, 6)):
        packed = zstd.compress(data)
        head = bytes(16) + struct.pack("<QI", len(data), 0) + struct.pack("<I4s", 4, b"zstd")
        chunk = head + struct.pack("<Q", len(packed)) + packed
        data = (b"\x06" + struct.pack("<Q", len(chunk)) + chunk) * rng.randint(1, 9)
    return b"\x89MCAP0\r\n" + data


def sqlite_views(rng):
    database = sqlite3.connect(":memory:")
    database.executescript(
        "CREATE TABLE topics (id, name, type, serialization_format);"
        "INSERT INTO topics VALUES (1, '/scan', 'sensor_msgs/msg/LaserScan', 'cdr');"
        "CREATE TABLE messages (id, topic_id, timestamp, data);"
        f"INSERT INTO messages VALUES (1, 1, 1, zeroblob({rng.choice((10, 10**6, 10**8))}));"
    )
    return database.serialize()


def pdf_forms(rng):
    count = rng.randint(3, 20)
    times = rng.randint(2, 20)
    parts = ["%PDF-1.4\n1 0 obj<</Type/Catalog/Pages 2 0 R>>endobj\n"]
    parts.append("2 0 obj<</Type/Pages/Kids[3 0 R]/Count 1>>endobj\n")
    held = "/Resources<</XObject<</F {} 0 R>>>>"
    page = f"/MediaBox[0 0 99 99]{held.format(5)}/Contents 4 0 R"
    parts.append(f"3 0 obj<</Type/Page/Parent 2 0 R{page}>>endobj\n")
    for n in range(4, 4 + count):
        last = n == 3 + count
        stream = "0 0 m 9 9 l S" if last else "/F Do " * (times if n > 4 else 1)
        form = "" if n == 4 else "/Type/XObject/Subtype/Form/BBox[0 0 99 99]"
        inner = "" if last or n == 4 else held.format(n + 1)
        parts.append(
            f"{n} 0 obj<<{form}{inner}/Length {len(stream)}>>stream\n{stream}\nendstream endobj\n"
        )
    return "".join(parts) + "trailer<</Root 1 0 R/Size 99>>\nstartxref\n9\n%%EOF"


BOMBS = [
    (svg_uses, "svg"), (svg_clips, "svg"), (svg_zigzag, "svg"), (svg_entities, "svg"),
    (svg_deep, "svg"), (dxf_arrays, "dxf"), (geojson_deep, "geojson"), (geojson_stars, "geojson"),
    (geojson_stack, "geojson"), (toml_keys, "toml"), (yaml_aliases, "yaml"),
    (gltf_accessors, "gltf"), (png_large, "png"), (log_lines, "log.gz"),
    (text_of_one_character, "csv"), (text_of_one_character, "log"), (npz_large, "npz"),
    (mcap_chunks, "mcap"), (sqlite_views, "db3"), (pdf_forms, "pdf"),
]  # fmt: skip


# What a bomb takes, seen from a small process: a child's peak begins with its parent's. Computing
# ends after 2 s instead of 13.
TRIED = """
import json, resource, sys, warnings
import lrf3d
from lrf3d.base import isolation
isolation.LEAST_SECONDS = 1
kind, path, options = sys.argv[1:]
warnings.simplefilter("ignore")
try:
    said = repr(getattr(lrf3d, kind)(path, **json.loads(options)))
except lrf3d.Lrf3dError as error:
    said = f"refused: {error}"
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([said, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e6]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", range(COUNT))
def test_a_bomb_is_a_value_or_one_line(number, written, tmp_path, monkeypatch):
    monkeypatch.setenv(isolation.FACTOR, "1")
    make, ending = BOMBS[number % len(BOMBS)]
    path = written(f"a.{ending}", make(random.Random(number)))
    is_log = ending in ("log.gz", "csv", "log", "npz", "mcap", "db3")
    kind = "load_log" if is_log else "load_world"
    options = {"resolution": 0.05} if ending == "png" else {}
    tried = [sys.executable, "-c", TRIED, kind, str(path), json.dumps(options)]
    done = subprocess.run(tried, capture_output=True, text=True, check=True)
    said, seconds, peak = json.loads(done.stdout)
    print(f"{make.__name__} {number}: {seconds:.1f} s, {peak:.2f} GB, {said[-110:]}")
    if said.startswith("refused: "):
        assert said.startswith(f"refused: {tmp_path}") and "\n" not in said
    assert seconds < 10 + path.stat().st_size / 300_000
    assert peak < 1.5 + path.stat().st_size / 30e6
