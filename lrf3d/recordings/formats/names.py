"""Names of columns, arrays and fields: what they hold, and in which units.

A name enters `meaning`; one of the `ROLES` and a unit leave.
"""

import re
from collections.abc import Sequence
from functools import lru_cache

from lrf3d.recordings.formats.units import ANGLES, COUNTS, LENGTHS, TIMES

# What columns hold, and their units; of these, the first one is that of lrf3d.
ROLES = {
    "stamp": TIMES, "dt": TIMES,
    "x": LENGTHS, "y": LENGTHS, "theta": ANGLES, "dx": LENGTHS, "dy": LENGTHS,
    "dtheta": ANGLES, "left": COUNTS, "right": COUNTS, "ranges": LENGTHS, "angles": ANGLES,
    "qx": COUNTS, "qy": COUNTS, "qz": COUNTS, "qw": COUNTS, "quality": COUNTS, "nanosec": COUNTS,
}  # fmt: skip

# Finds the axis of a quaternion, which is the group.
QUATERNION = re.compile(
    r"(?:orientation|rotation|quaternion|quat|(?<![^\W_])(?:q|rot|ori))[\W_]?([wxyz])$"
).search

# The words of units.
UNITS = {unit for units in ROLES.values() for unit in units}

# Numbers that a format or a recording may give for all scans, and their units.
SETTINGS = {
    "first": ANGLES, "last": ANGLES, "step": ANGLES, "tick": LENGTHS, "track": LENGTHS,
    "offset": LENGTHS,
}  # fmt: skip

# Words for columns in headers, and for arrays.
SYNONYMS = {
    "stamp": "stamp time timestamp datetime t ts sec secs seconds zeit temps tiempo tempo tijd"
    " время 时间",
    "nanosec": "nanosec nanosecs nsec nsecs", "x": "x px posx tx",
    "y": "y py posy ty",
    "theta": "theta th yaw heading phi orientation cap rumbo richtung kurs",
    "left": "left leftticks enc_left", "right": "right",
    "dx": "dx", "dy": "dy", "dtheta": "dtheta dyaw dth", "qx": "qx", "qy": "qy", "qz": "qz",
    "qw": "qw",
    "angles": "angle angule bearing azimuth winkel deg angulo ángulo angolo hoek угол 角度",
    "quality": "quality q confidence",
    "poses": "poses pose trajectory odometry odom",
    "ranges": "ranges range r distances distance dist d scan laser lidar readings"
    " abstand entfernung distancia distanza distância afstand расстояние 距离",
}  # fmt: skip

# Roles by these words.
ROLE_OF = {word: role for role, words in SYNONYMS.items() for word in words.split()}

# Roles of fields of ROS messages that are settings, or hold something else than their words say.
MESSAGE_FIELDS = {
    "angle_min": "first",
    "angle_max": "last",
    "min_theta": "first",
    "max_theta": "last",
    "angle_increment": "step",
    "min_angle": "first",
    "max_angle": "last",
    "start_angle": "first",
    "end_angle": "last",
} | dict.fromkeys(
    "scan_time time_increment range_min range_max seq frame_id child_frame_id z".split(), ""
)

# What stands for the elements that ``ros2 topic echo`` leaves out.
CUT = "..."

# What to do then.
WHOLE = "arrays are cut: ros2 topic echo --full-length prints them whole"

# Words of columns that are not poses, though they have an x and a y, or that count.
FOREIGN = set(
    "acceleration accel acc velocity vel twist gyro covariance id idx index number nr count"
    " intensity intensities cos sin new no num roll pitch".split()
)

# Names of columns and fields that say of which robot a line is.
ROBOTS = set("robot robot_id robot_name agent agent_id vehicle vehicle_id".split())


# Records repeat their names, and a header may have thousands of columns of one.
@lru_cache(1 << 12)
def meaning(name: str) -> tuple[str, str]:
    """What a column of this name holds, and its unit, as far as the name says so."""
    name = re.sub("(deg)rees?|(rad)ians?|(f)ee(t)|(inch)es", r"\1\2\3\4\5", name.lower())
    name = re.sub(r"(?<=[\W_])in\W*$", "inch", name)
    if quaternion := QUATERNION(name):
        return f"q{quaternion[1]}", ""
    last, degrees, _ = re.split("[./]", name)[-1].partition("_deg")
    if last in MESSAGE_FIELDS:
        return MESSAGE_FIELDS[last], degrees[1:] or "rad"
    words = [word for word in re.split(r"[\W\d_]+", name) if word]
    if FOREIGN.intersection(words):
        return "", ""
    *_, unit = "", *(word for word in words if word in UNITS)
    role = _role_of([word for word in words if word not in UNITS or len(words) == 1])
    return role, unit if unit in ROLES.get(role, {}) else ""


def _role_of(words: Sequence[str]) -> str:
    """The role of the last word that has one, in the singular or the plural; "" if none has."""
    for word in reversed(words):
        word = "stamp" if word.endswith("timestamp") else word
        if role := ROLE_OF.get(word) or ROLE_OF.get(word.removesuffix("s")):
            return role
    return ""
