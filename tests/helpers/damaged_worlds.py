"""Small world files of every format, and what damage and malice make of them; always the same."""

import io
import json
import random
import struct
import zlib
from collections.abc import Iterator
from functools import cache

import trimesh
from PIL import Image, ImageDraw

YAML = (
    "image: map.png\nresolution: 0.1\norigin: [1.0, -2.0, 0.5]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)

OSM = """<?xml version="1.0" encoding="UTF-8"?>
<osm version="0.6">
 <node id="1" lat="52.0" lon="4.0"/><node id="2" lat="52.0" lon="4.001"/>
 <node id="3" lat="52.001" lon="4.001"/><node id="4" lat="52.001" lon="4.0"/>
 <way id="10"><nd ref="1"/><nd ref="2"/><nd ref="3"/><nd ref="4"/><nd ref="1"/>
  <tag k="building" v="yes"/><tag k="building:levels" v="4"/></way>
</osm>
"""

SVG = """<?xml version="1.0"?>
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
 width="100mm" height="50mm" viewBox="0 0 1000 500">
<defs><rect id="r" width="100" height="100"/></defs>
<rect x="0" y="0" width="1000" height="500"/><g transform="translate(10,20) scale(2)">
<circle cx="10" cy="10" r="5"/><use xlink:href="#r" x="5"/></g>
<path d="M0 0 L10 10 C 20 20 30 20 40 10 Q 5 5 6 7 A 3 4 10 0 1 9 9 z"/></svg>
"""

TOML = 'name = "a"\n[[object]]\nname = "b"\npoints = [[0, 0], [4, 0], [4, 3]]\nclosed = true\n'

RING = [[0, 0], [9, 0], [9, 7], [0, 7], [0, 0]]
GEOJSON = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"height": 6},
            "geometry": {"type": "Polygon", "coordinates": [RING]},
        }
    ],
}


def picture(kind: str) -> bytes:
    """A room drawn black on white."""
    image = Image.new("L", (40, 30), 254)
    ImageDraw.Draw(image).rectangle([5, 5, 34, 24], outline=0)
    out = io.BytesIO()
    image.save(out, kind)
    return out.getvalue()


def dxf(body: str = "", header: str = "", blocks: str = "") -> bytes:
    """A drawing of one line and a body, in the oldest form, which needs no more."""
    line = "0\nLINE\n8\n0\n10\n0.0\n20\n0.0\n11\n5.0\n21\n3.0\n"
    return (
        f"0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n{header}0\nENDSEC\n"
        f"0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n"
        f"0\nSECTION\n2\nENTITIES\n{line}{body}0\nENDSEC\n0\nEOF\n"
    ).encode()


@cache
def valid() -> dict[str, dict[str, bytes]]:
    """For each ending the files of a world, the one to open first."""
    box = trimesh.creation.box((4.0, 3.0, 2.0))
    worlds = {
        "toml": {"a.toml": TOML.encode()},
        "geojson": {"a.geojson": json.dumps(GEOJSON).encode()},
        "osm": {"a.osm": OSM.encode()},
        "svg": {"a.svg": SVG.encode()},
        "dxf": {"a.dxf": dxf("0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n2\n")},
        "yaml": {"a.yaml": YAML.encode(), "map.png": picture("PNG")},
        "pgm": {"a.yaml": YAML.replace("png", "pgm").encode(), "map.pgm": picture("PPM")},
    }
    for kind in ("glb", "obj", "off", "ply", "stl"):
        data = box.export(file_type=kind)
        worlds[kind] = {f"a.{kind}": data if isinstance(data, bytes) else data.encode()}
    parts = trimesh.Scene(box).export(file_type="gltf")
    parts["a.gltf"] = parts.pop("model.gltf")
    worlds["gltf"] = {"a.gltf": parts.pop("a.gltf"), **parts}
    return worlds


def damaged() -> Iterator[tuple[str, dict[str, bytes]]]:
    """A name and the files of worlds that may or may not be readable still."""
    for kind, files in valid().items():
        first, *beside = files
        # Of a map, it is the picture that most is to be said about.
        target = beside[0] if beside else first
        data = files[target]
        rng = random.Random(kind)
        for share in (10, 40, 70, 95):
            yield f"{kind} cut at {share} %", {**files, target: data[: len(data) * share // 100]}
        for turn in range(6):
            spoilt = bytearray(data)
            for _ in range(1 + 3 * turn):
                spoilt[rng.randrange(len(data))] = rng.randrange(256)
            yield f"{kind} spoilt {turn}", {**files, target: bytes(spoilt)}
        for turn in range(3):
            start = rng.randrange(len(data) - 8)
            end = start + rng.randrange(1, len(data) // 3)
            yield f"{kind} with a hole {turn}", {**files, target: data[:start] + data[end:]}
            twice = data[:end] + data[start:]
            yield f"{kind} with a part twice {turn}", {**files, target: twice}
        for word in (b"nan", b"1e999", b"-1", b"99999999999999999999", b'""', b"\xff\xfe", b"\0"):
            places = [i for i, byte in enumerate(data) if byte in b"0123456789"] or [0]
            place = rng.choice(places)
            changed = data[:place] + word + data[place + 1 :]
            yield f"{kind} with {word!r}", {**files, target: changed}


def unreadable() -> Iterator[tuple[str, dict[str, bytes]]]:
    """A name and the files of worlds that must be refused."""
    rng = random.Random(0)
    noise = rng.randbytes(5000)
    for kind, files in valid().items():
        first = next(iter(files))
        for what, data in {
            "empty": b"",
            "a byte": b"\0",
            "blank": b" \n\n ",
            "noise": noise,
            "zeros": bytes(5000),
            "of another kind": b"%PDF-1.4 not a world",
        }.items():
            yield f"{kind} {what}", {**files, first: data}
        if kind in ("toml", "geojson", "dxf", "yaml"):
            yield f"{kind} in UTF-16", {**files, first: files[first].decode().encode("utf-16")}
    for kind, bodies in HOSTILE.items():
        for what, body in bodies.items():
            name = f"a.{kind}"
            yield f"{kind} {what}", {name: body if isinstance(body, bytes) else body.encode()}
    for what, (line, picture_data) in MAPS.items():
        key = line.partition(":")[0]
        kept = [row for row in YAML.splitlines() if not row.startswith(f"{key}:")]
        text = "\n".join([*kept, line]) + "\n"
        yield f"map with {what}", {"a.yaml": text.encode(), "map.png": picture_data}


def png(width: int, height: int, data: bytes) -> bytes:
    """A grey picture that says it is of a size, whatever the data say."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + check

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(data))
        + chunk(b"IEND", b"")
    )


def _glb(document: object, binary: bytes = b"") -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _gltf(uri: str, count: int = 3, **more: object) -> dict[str, object]:
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": uri, "byteLength": 36}],
        **more,
    }


def _feature(geometry: object, **properties: object) -> str:
    return json.dumps({"type": "Feature", "properties": properties, "geometry": geometry})


def _block(name: str, *inserts: str) -> str:
    inside = "".join(f"0\nINSERT\n8\n0\n2\n{one}\n10\n0\n20\n0\n" for one in inserts)
    inside = inside or "0\nLINE\n8\n0\n10\n0\n20\n0\n11\n1\n21\n1\n"
    return f"0\nBLOCK\n8\n0\n2\n{name}\n70\n0\n10\n0\n20\n0\n3\n{name}\n{inside}0\nENDBLK\n8\n0\n"


def _insert(name: str, more: str = "") -> str:
    return f"0\nINSERT\n8\n0\n2\n{name}\n10\n0\n20\n0\n{more}"


_LAUGHS = (
    "<!DOCTYPE {0} [<!ENTITY a0 'ha'>"
    + "".join(f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 10))
    + "]><{0}>&a9;</{0}>"
)
_OUTSIDE = '<!DOCTYPE {0} [<!ENTITY x SYSTEM "file:///etc/passwd">]><{0}>&x;</{0}>'
_NODE = '<node id="1" lat="{}" lon="{}"/>'
_WAY = '<way id="1"><nd ref="{}"/><nd ref="2"/><tag k="building" v="yes"/></way>'
_PLY = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
)
_DEEP = 100_000

HOSTILE: dict[str, dict[str, str | bytes]] = {
    "toml": {
        "a key of many parts": ".".join("a" * 20_000) + " = 1",
        "deep": "x = " + "[" * _DEEP,
        "deep table": "[" + ".".join("a" * 1 for _ in range(5000)) + "]\nx = 1",
        "nan": TOML.replace("4, 0", "nan, 0"),
        "inf": TOML.replace("4, 0", "inf, 0"),
        "far": TOML.replace("4, 0", "1e300, 0"),
        "long number": TOML.replace("4, 0", "4" * 5000 + ", 0"),
        "text for points": TOML.replace("[[0, 0], [4, 0], [4, 3]]", '"points"'),
        "no height": TOML + "height = -1\n",
        "a huge object number": TOML + "number = 999999999999\n",
        "no object": 'name = "a"',
    },
    "geojson": {
        "deep": "[" * _DEEP,
        "deep objects": '{"a":' * _DEEP,
        "deep geometries": '{"type":"GeometryCollection","geometries":[' * 400 + "]}" * 400,
        "nan": json.dumps(GEOJSON).replace("9, 0", "NaN, 0"),
        "inf": json.dumps(GEOJSON).replace("9, 0", "1e999, 0"),
        "far": json.dumps(GEOJSON).replace("9, 0", "1e300, 0"),
        "long number": json.dumps(GEOJSON).replace("9, 0", "9" * 5000 + ", 0"),
        "text for a place": json.dumps(GEOJSON).replace("9, 0", '"9", 0'),
        "a list": "[]",
        "a number": "5",
        "null features": '{"type": "FeatureCollection", "features": null}',
        "no feature": '{"type": "FeatureCollection", "features": []}',
        "a feature of text": '{"type": "FeatureCollection", "features": ["x"]}',
        "points alone": _feature({"type": "Point", "coordinates": [1, 2]}),
        "an unknown geometry": _feature({"type": "Sphere", "coordinates": [[1, 2]]}),
        "an empty polygon": _feature({"type": "Polygon", "coordinates": []}),
        "an outline that crosses itself without end": _feature(
            {
                "type": "Polygon",
                "coordinates": [[[i * 7919 % 997, i * 104729 % 991] for i in range(3000)]],
            }
        ),
        "a flat polygon": _feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [2, 0]]]}),
        "a negative height": _feature({"type": "Polygon", "coordinates": [RING]}, height=-3),
        "properties of text": '{"type": "Feature", "properties": "x", "geometry": null}',
    },
    "osm": {
        "entities": _LAUGHS.format("osm"),
        "an outside entity": _OUTSIDE.format("osm"),
        "another root": "<gpx></gpx>",
        "nothing": "<osm></osm>",
        "deep": "<osm>" + "<a>" * _DEEP,
        "nan": f"<osm>{_NODE.format('nan', 4)}</osm>",
        "a latitude of 91": f"<osm>{_NODE.format(91, 4)}</osm>",
        "a longitude of text": f"<osm>{_NODE.format(1, 'x')}</osm>",
        "a huge number": OSM.replace('id="1"', f'id="{10**30}"'),
        "no number": OSM.replace('ref="1"', 'ref="one"'),
        "a way to nowhere": f"<osm>{_WAY.format(7)}</osm>",
        "no building": OSM.replace("building", "highway"),
        "buildings on both sides of the Earth": OSM.replace('lon="4.0"', 'lon="-170"'),
        "an unknown encoding": OSM.replace("UTF-8", "EBCDIC-9"),
        "a wrong encoding": OSM.replace("UTF-8", "UTF-16"),
        "a doubled attribute": OSM.replace('id="1"', 'id="1" id="1"'),
    },
    "svg": {
        "entities": _LAUGHS.format("svg"),
        "an outside entity": _OUTSIDE.format("svg"),
        "another root": "<html></html>",
        "nothing": '<svg xmlns="http://www.w3.org/2000/svg"/>',
        "deep": "<svg>" + "<g>" * _DEEP,
        "a use of itself": SVG.replace('<rect id="r"', '<g id="r"><use xlink:href="#r"/></g><rect'),
        "uses in a ring": SVG.replace(
            "<defs>", '<defs><g id="p"><use href="#q"/></g><g id="q"><use href="#p"/></g>'
        ),
        "uses of uses": SVG.replace(
            "<defs>",
            "<defs>"
            + '<rect id="u0" width="1" height="1"/>'
            + "".join(
                f'<g id="u{i}">{f"""<use href="#u{i - 1}"/>""" * 10}</g>' for i in range(1, 9)
            ),
        ).replace('xlink:href="#r"', 'href="#u8"'),
        "a use of another file": SVG.replace("#r", "../secret.svg#r"),
        "a negative width": SVG.replace("100mm", "-100mm"),
        "an unknown unit": SVG.replace("100mm", "100furlong"),
        "a viewBox of nothing": SVG.replace("0 0 1000 500", "0 0 0 0"),
        "a viewBox of text": SVG.replace("0 0 1000 500", "all of it"),
        "a viewBox of nan": SVG.replace("0 0 1000 500", "0 0 nan nan"),
        "a huge circle": SVG.replace('r="5"', 'r="1e300"'),
        "texts alone": "<svg xmlns='http://www.w3.org/2000/svg'><text>wall</text></svg>",
        "hidden lines alone": (
            "<svg xmlns='http://www.w3.org/2000/svg'><line x2='5' display='none'/></svg>"
        ),
    },
    "dxf": {
        "blocks in a ring": dxf(_insert("A"), blocks=_block("A", "B") + _block("B", "A")),
        "a block in itself": dxf(_insert("A"), blocks=_block("A", "A")),
        "blocks of blocks": dxf(
            _insert("B9"),
            blocks=_block("B0")
            + "".join(_block(f"B{i}", *[f"B{i - 1}"] * 10) for i in range(1, 10)),
        ),
        "a million copies": dxf(
            _insert("B0", "70\n30000\n71\n30000\n44\n1\n45\n1\n"), blocks=_block("B0")
        ),
        "nan": dxf("0\nLINE\n8\n0\n10\nnan\n20\n0\n11\n1\n21\n1\n"),
        "inf": dxf("0\nLINE\n8\n0\n10\ninf\n20\n0\n11\n1\n21\n1\n"),
        "far": dxf("0\nLINE\n8\n0\n10\n1e300\n20\n0\n11\n1\n21\n1\n"),
        "a huge circle": dxf("0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n1e300\n"),
        "an unknown unit": dxf(header="9\n$INSUNITS\n70\n99\n"),
        "a text for a number": dxf("0\nLINE\n8\n0\n10\nten\n20\n0\n11\n1\n21\n1\n"),
        "no entity": b"0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n",
        "no end": dxf()[:-10],
    },
    "yaml": {
        "aliases of aliases": "a0: &a0 [x]\n"
        + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)),
        "merges of merges": "a0: &a0 {x: 1}\n"
        + "".join(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 8)),
        "deep": "[" * 20_000,
        "an object to make": "!!python/object/apply:os.system ['true']",
        "a tag": "image: !!binary x",
        "a list": "- a\n- b",
        "tabs": "image:\tmap.png\n\t- x",
        "large": "# " + "x" * 100_000,
    },
    "glb": {
        "a huge count": _glb(_gltf("data:application/octet-stream;base64,AAAA", 10**12)),
        "a wrong length": struct.pack("<4sII", b"glTF", 2, 1 << 31) + b"\0" * 40,
        "no mesh": _glb({"asset": {"version": "2.0"}, "scenes": [{"nodes": []}]}),
        "an outside buffer": _glb(_gltf("../secret.bin")),
        "an absolute buffer": _glb(_gltf("/etc/passwd")),
        "a buffer from the net": _glb(_gltf("https://example.org/a.bin")),
        "nodes in a ring": _glb(
            _gltf("a.bin", nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}])
        ),
        "a list": _glb([]),
    },
    "gltf": {
        "an outside buffer": json.dumps(_gltf("../secret.bin")),
        "an absolute buffer": json.dumps(_gltf("/etc/passwd")),
        "a buffer that is not there": json.dumps(_gltf("none.bin")),
        "deep": "[" * _DEEP,
    },
    "obj": {
        "faces of nothing": "v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 99\n",
        "nan": "v nan 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n",
        "far": "v 1e300 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n",
        "vertices alone": "v 0 0 0\nv 1 0 0\n",
        "a floor alone": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    },
    "off": {
        "a huge count": "OFF\n1000000000 1000000000 0\n0 0 0\n",
        "nan": "OFF\n3 1 0\nnan 0 0\n1 0 0\n0 1 1\n3 0 1 2\n",
        "faces of nothing": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 1\n3 0 1 7\n",
        "a negative count": "OFF\n-3 -1 0\n",
    },
    "ply": {
        "a huge count": _PLY.format("binary_little_endian", 10**9) + "end_header\n",
        "a negative count": _PLY.format("ascii", -5) + "end_header\n",
        "an unknown format": _PLY.format("morse", 3) + "end_header\n",
        "no end of the header": _PLY.format("ascii", 3),
        "vertices alone": _PLY.format("ascii", 1) + "end_header\n0 0 0\n",
    },
    "stl": {
        "a huge count": bytes(80) + struct.pack("<I", 1 << 31) + bytes(50),
        "a solid of nothing": "solid a\nendsolid a\n",
        "nan": bytes(80) + struct.pack("<I", 1) + struct.pack("<12fH", *[float("nan")] * 12, 0),
        "a half facet": "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n",
    },
}
"""What must be refused, by ending and by what is wrong with it."""

_ROOM = picture("PNG")

MAPS: dict[str, tuple[str, bytes]] = {
    "an outside picture": ("image: ../map.png", _ROOM),
    "an absolute picture": ("image: /etc/passwd", _ROOM),
    "a picture that is not there": ("image: none.png", _ROOM),
    "no picture": ("image: ''", _ROOM),
    "a folder for a picture": ("image: .", _ROOM),
    "a number for a picture": ("image: 7", _ROOM),
    "a null in the name": ('image: "a\\0b.png"', _ROOM),
    "no resolution": ("resolution: ''", _ROOM),
    "resolution 0": ("resolution: 0.0", _ROOM),
    "resolution -1": ("resolution: -1", _ROOM),
    "resolution nan": ("resolution: .nan", _ROOM),
    "resolution inf": ("resolution: .inf", _ROOM),
    "an origin of two": ("origin: [1, 2]", _ROOM),
    "an origin of nan": ("origin: [1, 2, .nan]", _ROOM),
    "an origin of text": ("origin: [a, b, c]", _ROOM),
    "a threshold of 2": ("occupied_thresh: 2", _ROOM),
    "thresholds the wrong way round": ("free_thresh: 0.9", _ROOM),
    "negate maybe": ("negate: maybe", _ROOM),
    "an unknown mode": ("mode: fancy", _ROOM),
    "a white picture": ("mode: trinary", png(20, 20, (b"\0" + b"\xff" * 20) * 20)),
    "a huge picture": ("mode: trinary", png(100_000, 100_000, b"\0" * 1000)),
    "a picture of nothing": ("mode: trinary", png(0, 0, b"")),
    "a picture of few data": ("mode: trinary", png(5000, 5000, b"\0" * 100)),
    "a GIF": ("mode: trinary", b"GIF89a\1\0\1\0\0\0\0;"),
    "a text for a picture": ("mode: trinary", b"P5\nwide high\n255\n"),
    "a huge PGM": ("mode: trinary", b"P5\n99999999 99999999\n255\n"),
    "a PGM of a long number": ("mode: trinary", b"P5\n" + b"9" * 100_000),
    "a little noise": ("mode: trinary", b"P5\n300 300\n255\n" + random.Random(2).randbytes(90_000)),
    "noise in a PGM": (
        "mode: trinary",
        b"P5\n3000 3000\n255\n" + random.Random(1).randbytes(9_000_000),
    ),
}
"""A line of a map's description, and its picture; together they must be refused."""
