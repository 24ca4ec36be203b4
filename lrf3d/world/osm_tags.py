"""What the tags of an OpenStreetMap building say; they are free text, so what is odd says nothing.

Source: the wiki's pages Key:building, Key:height, Key:min_height and Key:building:levels.
"""

from lrf3d.world.colours import parse_colour
from lrf3d.world.geojson_features import LEVEL_HEIGHT, metres_of

HIGHEST = 1000.0
"""Height [m] above which a tag is taken for a slip of the pen."""

ABOVE_BEAMS = 2.0
"""From what height above the ground [m] on a building stands over the robot and not in its way."""

NO_WALLS = {"no", "roof", "carport"}
"""Values of the tag building that are of no walls."""


def is_building(tags: dict[str, str]) -> bool:
    """Whether tags are of a building whose walls stand on the ground."""
    if tags.get("building", "no") in NO_WALLS or tags.get("location") == "underground":
        return False
    above = metres_of(tags.get("min_height", ""))
    if above is None:
        above = LEVEL_HEIGHT * (metres_of(tags.get("building:min_level", "")) or 0.0)
    return above < ABOVE_BEAMS


def tag_height(tags: dict[str, str]) -> float | None:
    """Height [m] of a building above the ground, or None where nothing is said."""
    height = metres_of(tags.get("height", "")) or metres_of(tags.get("building:height", ""))
    if height is None:
        levels = metres_of(tags.get("building:levels", "")) or 0.0
        height = LEVEL_HEIGHT * (levels + (metres_of(tags.get("roof:levels", "")) or 0.0))
    return height if 0.0 < height <= HIGHEST else None


def tag_colour(tags: dict[str, str]) -> tuple[float, float, float] | None:
    """The colour of a building, where one is given in a form that is understood."""
    return parse_colour(tags.get("building:colour"))


def name_of(tags: dict[str, str]) -> str:
    """What a building is called: its name, or street and number."""
    address = f"{tags.get('addr:street', '')} {tags.get('addr:housenumber', '')}".strip()
    return tags.get("name") or address
