"""Tags, as OpenStreetMap, GeoJSON and IMDF have them: what stands as walls, and why others do not.

The tags of one feature enter, texts by keys; its role leaves, or the reason to leave it out. Tags
are free text, which OpenStreetMap's wiki defines; a value that cannot be read counts as not given.
"""

import re
from collections.abc import Mapping
from operator import mul
from typing import Any

# Height of a storey [m], for buildings with only a number of levels.
LEVEL_HEIGHT = 3.0

# Metres in a foot, and in an inch.
FOOT = 0.3048
INCH = 0.0254

# Metres in the units of heights.
UNITS = {
    **dict.fromkeys(("", "m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "'", "′"), FOOT),
    **dict.fromkeys(("in", "inch", "inches", '"', "″"), INCH),
    "mm": 1e-3,
    "cm": 1e-2,
    "km": 1e3,
    "yd": 0.9144,
}

# Matches a number and its unit in a length.
_LENGTH = re.compile(r"(\d+(?:[.,]\d*)?|[.,]\d+)\s*([^\s\d.,]*)")

# Properties of roads, water and land, on which nothing stands.
FLAT = frozenset(
    "highway railway waterway aeroway route boundary admin_level landuse natural water leisure"
    " power place parking public_transport".split()
)

# Values of ``building`` for buildings that do not exist yet, or no longer.
ABSENT = ("proposed", "planned", "demolished", "razed")

# Values of ``barrier`` that become walls.
BARRIERS = ("wall", "fence", "city_wall", "retaining_wall")


# Properties of what is built.
STANDS = frozenset("building building:part barrier wall height object indoor room level".split())


# Prefixes of keys of what is planned, or was there.
GONE = ("proposed:", "planned:", "demolished:", "razed:", "removed:", "was:")

# Kinds of IMDF's features that show nothing which stands.
IMDF_FLAT = frozenset(
    "address amenity anchor building geofence level manifest occupant relationship section"
    " venue".split()
)


def tags_of(properties: Mapping[str, Any]) -> dict[str, str]:
    """The tags that properties give, as texts; a value such as "no" for most keys gives none."""
    plain = {k: v for k, v in properties.items() if isinstance(v, str | int | float)}
    given = {k: str(v) for k, v in plain.items() if v is not False and v != ""}
    return {k: v for k, v in given.items() if v != "no" or k in ("building", "building:part")}


def left_out(tags: Mapping[str, str]) -> str:
    """The reason to leave out a feature with tags; empty if it stands.

    >>> left_out({"building": "roof"}), left_out({"barrier": "hedge"}), left_out({"indoor": "room"})
    ('building open at the ground', 'barrier: hedge', '')
    """
    built = {"building", "building:part"} & set(tags)
    gone = [key for key in tags if key.startswith(GONE)]
    kind = tags.get("feature_type", "")
    if kind in IMDF_FLAT:
        return f"IMDF feature: {kind}"
    if set(tags) & FLAT and not set(tags) & STANDS:
        return "feature of roads, water and land"
    if gone and not set(tags) & STANDS:
        return gone[0]
    if built and tags.get("building") in ABSENT:
        return f"building: {tags['building']}"
    if built and not is_building(tags):
        return "building open at the ground" if kind_of(tags) else "building: no"
    if not built and tags.get("barrier", "wall") not in BARRIERS:
        return f"barrier: {tags['barrier']}"
    return "indoor area without walls" if tags.get("indoor") == "area" and not built else ""


def kind_of(tags: Mapping[str, str]) -> str:
    """The kind of a building, or of a part of one; empty if it is neither."""
    kind = tags.get("building", tags.get("building:part", ""))
    return "" if kind.lower() in ("no", "false", "0") else kind


def is_building(tags: Mapping[str, str]) -> bool:
    """Whether tags describe a building whose walls reach the ground."""
    if kind_of(tags) in ("", "roof", "carport", *ABSENT) or tags.get("location") == "underground":
        return False
    above = metres_of(tags.get("min_height", ""))
    if above is None:
        above = LEVEL_HEIGHT * (metres_of(tags.get("building:min_level", "")) or 0.0)
    # The robot passes under what is higher.
    return above < 2.0


def role_in_storey(tags: Mapping[str, str]) -> str:
    """What a feature is in a storey: a room, an opening, a wall, or none of these.

    By OpenStreetMap's Simple Indoor Tagging, or by IMDF.
    """
    kind = tags.get("feature_type", "")
    indoor = tags.get("indoor", "")
    if {"building", "building:part", "barrier"} & set(tags):
        return ""
    if kind == "opening" or tags.get("door", "no") != "no":
        return "opening"
    if indoor == "wall" or kind in ("fixture", "kiosk", "detail"):
        return "wall"
    unit = kind == "unit" or (not kind and {"category", "level_id"} <= set(tags))
    named = indoor == "yes" and tags.get("room", "no") != "no"
    return "room" if unit or named or indoor in ("room", "corridor") else ""


def storeys_of(tags: Mapping[str, str]) -> tuple[str, ...]:
    """The storeys of a feature: by its level, such as 1, "0;1" or "-1-2", and where it is repeated.

    >>> storeys_of({"level": "0;2"}), storeys_of({"level": "1", "repeat_on": "3-4"}), storeys_of({})
    (('0', '2'), ('1', '3', '4'), ())
    """
    found = list[str]()
    names = (tags.get("level_id", tags.get("level", "")), tags.get("repeat_on", ""))
    for text in re.split(r"[;,]", ";".join(names)[:200]):
        span = re.fullmatch(r"\s*(-?\d{1,3})\s*-\s*(-?\d{1,3})\s*", text)
        if span:
            found += map(str, range(int(span[1]), int(span[2]) + 1))
        elif text.strip():
            found.append(re.sub(r"\.0+$", "", text.strip()))
    return tuple(found)


def metres_of(text: str) -> float | None:
    """A length [m] from a text such as 12, 12,5 m or 40'; None if it is invalid."""
    parts = _LENGTH.findall(text)
    # After feet come inches.
    units = [UNITS.get(unit.lower()) for _, unit in parts]
    if None in units or units not in ([FOOT, INCH], units[:1]) or _LENGTH.sub("", text).strip():
        return None
    numbers = [float(number.replace(",", ".")) for number, _ in parts]
    return sum(map(mul, numbers, units)) if parts else None
