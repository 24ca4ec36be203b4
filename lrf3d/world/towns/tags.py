"""Tags, as OpenStreetMap, GeoJSON and IMDF have them: what stands as walls, and why others do not.

The tags of one feature enter, texts by keys; its role leaves, or the reason to leave it out. Tags
are free text, which OpenStreetMap's wiki defines; a value that cannot be read counts as not given.
"""

import re
from collections.abc import Mapping
from operator import mul
from typing import Any

from lrf3d.base.units import FOOT, INCH, METRES

# Height of a storey [m], for buildings with only a number of levels.
LEVEL_HEIGHT = 3.0

# Metres in the units of heights.
UNITS = {
    **METRES,
    **dict.fromkeys(("", "m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "'", "′"), FOOT),
    **dict.fromkeys(("in", "inch", "inches", '"', "″"), INCH),
    "yd": 36 * INCH,
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

# Kinds of IMDF's features that stand in a room.
IMDF_WALLS = ("fixture", "kiosk", "detail")

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
    return next(filter(None, (reason(tags) for reason in REASONS)), "")


def _flat(tags: Mapping[str, str]) -> str:
    kind = tags.get("feature_type", "")
    if kind in IMDF_FLAT:
        return f"IMDF feature: {kind}"
    return "feature of roads, water and land" if set(tags) & FLAT and not set(tags) & STANDS else ""


def _gone(tags: Mapping[str, str]) -> str:
    gone = "" if set(tags) & STANDS else next((key for key in tags if key.startswith(GONE)), "")
    absent = _is_built(tags) and tags.get("building") in ABSENT
    return f"building: {tags['building']}" if absent else gone


def _open(tags: Mapping[str, str]) -> str:
    if not _is_built(tags) or is_building(tags):
        return ""
    return "building open at the ground" if kind_of(tags) else "building: no"


def _low(tags: Mapping[str, str]) -> str:
    barrier = tags.get("barrier", "wall")
    return "" if _is_built(tags) or barrier in BARRIERS else f"barrier: {barrier}"


def _unwalled(tags: Mapping[str, str]) -> str:
    area = tags.get("indoor") == "area" and not _is_built(tags)
    return "indoor area without walls" if area else ""


# What gives reasons to leave features out; the first reason counts.
REASONS = (_flat, _gone, _open, _low, _unwalled)


def _is_built(tags: Mapping[str, str]) -> bool:
    return "building" in tags or "building:part" in tags


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
    if _is_built(tags) or "barrier" in tags:
        return ""
    return next((role for role, has in ROLES.items() if has(tags)), "")


def _is_opening(tags: Mapping[str, str]) -> bool:
    return tags.get("feature_type") == "opening" or tags.get("door", "no") != "no"


def _is_wall(tags: Mapping[str, str]) -> bool:
    return tags.get("indoor") == "wall" or tags.get("feature_type") in IMDF_WALLS


def _is_room(tags: Mapping[str, str]) -> bool:
    kind = tags.get("feature_type", "")
    unit = kind == "unit" or (not kind and {"category", "level_id"} <= set(tags))
    named = tags.get("indoor") == "yes" and tags.get("room", "no") != "no"
    return unit or named or tags.get("indoor") in ("room", "corridor")


# Roles in a storey, and what has them; the first match counts.
ROLES = {"opening": _is_opening, "wall": _is_wall, "room": _is_room}


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
