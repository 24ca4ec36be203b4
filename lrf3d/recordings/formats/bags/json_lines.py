"""ROS messages as JSON, each with its topic, as rosbridge and ``mcap cat --json`` write them.

A file with an object in each line, or an array of objects, enters; messages leave, as from a bag.
"""

from collections.abc import Iterator
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

from lrf3d.messages.clouds import CLOUD
from lrf3d.messages.ros import ODOMETRY, SCAN, TRANSFORMS
from lrf3d.recordings.formats.arrays import json_parts
from lrf3d.recordings.formats.bags.files import BagTopic, Packet
from lrf3d.recordings.log import Intake

# The encoding of messages that are text.
JSON = "json"

# The types of messages, by their characteristic fields; the first match counts.
KINDS = {
    SCAN: {"ranges", "angle_min"},
    CLOUD: {"fields", "point_step"},
    TRANSFORMS: {"transforms"},
    ODOMETRY: {"pose", "twist"},
    "geometry_msgs/msg/PoseWithCovarianceStamped": {"pose.pose"},
    "geometry_msgs/msg/PoseStamped": {"pose"},
}

# Interval [ns] that is assumed between messages without stamps and times of receipt.
APART = 10_000_000

# Times since 1970 are less than this [s]; larger numbers are nanoseconds.
LATEST = 1e11

# Names of fields in ROS 1, and their names in ROS 2.
RENAMED = {"secs": "sec", "nsecs": "nanosec", "nsec": "nanosec"}


def json_messages(intake: Intake) -> Iterator[Packet]:
    """The topic, time of receipt [ns] and message of each object in a file."""
    text = b"".join(line for _, line in intake.lines())
    parts, read = json_parts(text.decode("utf-8", "replace"))
    for number, part in enumerate(parts):
        try:
            value = read(part)
        except (ValueError, RecursionError):
            intake.refuse(number + 1, "not JSON, or cut short", "message")
            continue
        # Other requests of rosbridge, such as subscribe, hold no message.
        fields = value if isinstance(value, dict) else {}
        bodies = [each for each in fields.values() if isinstance(each, dict)]
        if "topic" in fields and bodies:
            # Beside the message, times of receipt may be objects, too.
            body = max(bodies, key=lambda each: bool(_kind_of(each)))
            message = _message(body)
            received = _received(value, message) or APART * number
            yield BagTopic.of(str(value["topic"]), _kind_of(body), JSON), received, message


def _kind_of(message: dict[str, Any]) -> str:
    """The type of a message by its fields; "" if it is of no type that is read."""
    inner = message.get("pose")
    fields = {*message, *(f"pose.{name}" for name in (inner if isinstance(inner, dict) else ()))}
    return next((kind for kind, needed in KINDS.items() if needed <= fields), "")


def _message(value: Any) -> Any:
    """A message with its fields as attributes, by their names in ROS 2."""
    if isinstance(value, dict):
        fields = {RENAMED.get(str(name), str(name)): _message(each) for name, each in value.items()}
        if "stamp" in fields and not hasattr(fields["stamp"], "sec"):
            # A stamp may be null or seconds.
            sec, nanosec = divmod(_nanoseconds(fields["stamp"] or 0), 1_000_000_000)
            fields["stamp"] = SimpleNamespace(sec=sec, nanosec=nanosec)
        return SimpleNamespace(**fields)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [_message(each) for each in value]
    return value


def _received(value: dict[str, Any], message: Any) -> int:
    """When a message was received [ns], or its own stamp if that was not recorded."""
    if "log_time" in value:
        return _nanoseconds(value["log_time"])
    with suppress(AttributeError, IndexError, TypeError, ValueError):
        stamp = getattr(message, "transforms", [message])[0].header.stamp
        return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return 0


def _nanoseconds(time: Any) -> int:
    """A time [ns] that is a number or a text, in seconds or nanoseconds."""
    return int(time) if float(time) > LATEST else round(1_000_000_000 * float(time))
