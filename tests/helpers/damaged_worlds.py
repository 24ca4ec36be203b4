"""Small world files of every format, and damaged ones; always the same."""

import io
import json
import random
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

SDF = """<?xml version="1.0"?>
<sdf version="1.7"><world name="w"><model name="m"><pose>1 2 0.5 0 0 0.3</pose><link name="l">
<collision name="c"><geometry><box><size>4 3 1</size></box></geometry></collision>
</link></model></world></sdf>
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
        "sdf": {"a.sdf": SDF.encode()},
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
    """A name and the files of worlds of every kind that may or may not still be readable."""
    for kind, files in valid().items():
        # Of a map it is the picture that is damaged.
        target = list(files)[-1] if kind in ("yaml", "pgm", "gltf") else next(iter(files))
        data, rng = files[target], random.Random(kind)
        spoilt = bytearray(data)
        for _ in range(4):
            spoilt[rng.randrange(len(data))] = rng.randrange(256)
        number = next((k for k, byte in enumerate(data) if byte in b"123456789"), 0)
        changes = {
            "cut": data[: len(data) * 6 // 10],
            "spoilt": bytes(spoilt),
            "with a hole": data[: len(data) // 3] + data[len(data) // 2 :],
            "with nan": data[:number] + b"nan" + data[number + 1 :],
            "of another kind": b"%PDF-1.4 not a world",
        }
        for what, changed in changes.items():
            yield f"{kind} {what}", {**files, target: changed}


def _line(*points: list[object]) -> str:
    return json.dumps({"type": "LineString", "coordinates": points})


_ENTITY = '<!DOCTYPE {0} [<!ENTITY x SYSTEM "file:///etc/passwd">]><{0}>&x;</{0}>'
_INSERT = "0\nINSERT\n8\n0\n2\nA\n10\n0\n20\n0\n"
_BLOCK = f"0\nBLOCK\n8\n0\n2\nA\n70\n0\n10\n0\n20\n0\n3\nA\n{_INSERT}0\nENDBLK\n8\n0\n"

# Files that must be refused, and what the error says.
REFUSED: dict[str, tuple[str | bytes, str]] = {
    "deep.toml": ("x = " + "[" * 100_000, "not TOML|nested too deeply"),
    "digits.toml": (f"x = [{'9' * 5000}]", "not TOML: .*4300 digits"),
    "deep.geojson": ('{"a":' * 100_000, "nested too deeply"),
    "cameras.geojson": (json.dumps({**GEOJSON, "cameras": None}), "cameras: expected a list of"),
    "esri.geojson": ('{"rings": [[[0, 0], [9, 0], [9, 9]]]}', "feature 0: unknown geometry"),
    "nothing.geojson": ("", "not JSON: .*line 1"),
    "list.geojson": ("[1, 2]", "expected a GeoJSON object, found a JSON list"),
    "city.geojson": ('{"type": "CityJSONFeature"}', "CityJSON, which is not read; make.*cjio"),
    "topology.geojson": ('{"type": "Topology"}', "TopoJSON, which is not read; make"),
    "overpass.json": (
        '{"version": 0.6, "elements": [{"type": "way", "id": 1, "nodes": 3}]}',
        "expected the form of Overpass",
    ),
    "member.json": (
        '{"elements": [{"type": "relation", "id": 3, "members": [{"ref": 9, "role": "outer"}]}]}',
        "expected the form of Overpass",
    ),
    "bare.geojson": ('{"type": "FeatureCollection"}', "without a list of features"),
    "empty.geojson": ('{"type": "FeatureCollection", "features": []}', "holds no Polygon and no"),
    "three.geojson": ('{"type": "FeatureCollection", "features": [3]}', "0: expected a Feature"),
    "point.geojson": (_line([1, 2], [1, 2]), "feature 0: LineString of no"),
    "text.geojson": (_line([1, 2], ["a", 2]), "feature 0: LineString"),
    "huge.geojson": ('{"type": "LineString", "coordinates": [[1, 2], [1e999, 2]]}', "at most 1e"),
    "thin.geojson": (
        '{"type": "Polygon", "coordinates": [[[1, 2], [3, 4], [1, 2]]]}',
        "feature 0: Polygon",
    ),
    "twice.geojson": (
        _line([1, 2], [3, 4])[:-1] + ', "name": "a", "name": "b"}',
        "'name' stands twice",
    ),
    "height.geojson": (
        '{"type": "Feature", "properties": {"height": 3, "height": 30}, "geometry":'
        f" {_line([1, 2], [3, 4])}}}",
        "'height' stands twice",
    ),
    "entity.osm": (_ENTITY.format("osm"), "entity"),
    "encoding.osm": ('<?xml version="1.0" encoding="shift_jis"?><osm/>', "encodings"),
    "root.osm": ("<gpx></gpx>", "<osm> was expected"),
    "latitude.osm": (OSM.replace('lat="52.0"', 'lat="91"'), "node 1: .*degrees"),
    "number.osm": (OSM.replace('ref="1"', 'ref="one"'), "way 10: .*'one'"),
    "street.osm": (OSM.replace("building", "highway"), "no whole building"),
    "wide.osm": (OSM.replace('lon="4.0"', 'lon="-100"'), "apart"),
    "entity.svg": (_ENTITY.format("svg"), "entity"),
    "root.svg": ("<html></html>", "this is a web page"),
    "itself.svg": (SVG.replace("<defs>", '<g id="u"><use href="#u"/></g><defs>'), "within itself"),
    "unit.svg": (SVG.replace("100mm", "100furlong"), "width is '100furlong'"),
    "box.svg": (SVG.replace("0 0 1000 500", "0 0 0 0"), "viewBox is"),
    "circle.svg": (SVG.replace('r="5"', 'r="1e300"'), "too large|finite"),
    "text.svg": ("<svg xmlns='http://www.w3.org/2000/svg'><text>a</text></svg>", "no wall"),
    "itself.dxf": (dxf(_INSERT, blocks=_BLOCK), "within itself"),
    "unit.dxf": (dxf(header="9\n$INSUNITS\n70\n99\n"), "INSUNITS is 99"),
    "nan.dxf": (dxf("0\nLINE\n8\n0\n10\nnan\n20\n0\n11\n1\n21\n1\n"), "not finite"),
    "circle.dxf": (dxf("0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n1e300\n"), "finite|damaged"),
    "empty.dxf": (b"0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n", "no wall"),
    "nothing.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 99\n", "damaged"),
    "far.obj": ("v 1e300 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n", "not finite"),
    "floor.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nothing stands"),
    "solid.stl": ("solid a\nendsolid a\n", "damaged|no triangle"),
    "deep.gltf": ("[" * 100_000, "damaged"),
    "bare.sdf": ("<sdf><world/></sdf>", "no shape stands"),
    "root.sdf": ("<window/>", "expected <sdf>"),
    "number.sdf": (SDF.replace("4 3 1", "1 x 1"), "expected 3 numbers"),
    "nan.sdf": (SDF.replace("4 3 1", "4 2 nan"), "expected 3 numbers"),
    "deep.sdf": ("<sdf><model>" * 40 + "</model></sdf>" * 40, "models within|root|no shape"),
    "open.sdf": ("<sdf>", "no element|XML|unclosed"),
    # First bytes decide what a file is.
    "r2018.dxf": (b"AC1032\0\0", "DWG.*DXF"),
    "a.dwg": (b"AC1032\0\0", "DWG.*DXF"),
    "a.ifc": (b"ISO-10303-21;\nHEADER;", "IFC"),
    "a.dae": (b'<?xml version="1.0"?>\n<COLLADA>', "COLLADA"),
    "a.osm.pbf": (b"\0\0\0\r\n\tOSMHeader\x18", "PBF.*osmium"),
    "b.dxf": (b'<?xml version="1.0"?>\n<svg/>', r"SVG drawing; name it b\.svg"),
    "page.osm": (b"<!DOCTYPE html><html>", "web page"),
    "a.pcd": (b"# .PCD v0.7", "point cloud"),
    "missing.gltf": (b'{"buffers": [{"uri": "my%20room.bin"}]}', r"needs 'my room\.bin'"),
}

# A line of a map's description, and what the error says.
MAPS: dict[str, str] = {
    "image: ../other.png": "next to this file",
    "image: none.png": "no such file",
    "image: .": "next to this file",
    "resolution: -1": "resolution -1.0: expected a finite number, above 0",
    "origin: [1, 2]": "origin: expected [x, y, yaw]",
    "occupied_thresh: 2": "occupied_thresh 2: expected a finite number",
    "free_thresh: 0.9": "above occupied_thresh",
    "negate: maybe": "negate: expected 0 or 1, found",
    "mode: fancy": "mode: expected one of trinary, scale, raw",
    "a: [b": "no yaml file",
}
