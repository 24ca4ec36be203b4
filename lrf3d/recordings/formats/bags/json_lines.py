"""ROS messages as JSON, each with its topic, as rosbridge and ``mcap cat --json`` write them.

A file with an object in each line, or an array of objects, enters; messages leave, as from a bag.
"""

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from lrf3d.base.errors import InputError
from lrf3d.base.formats import head_of
from lrf3d.messages.ros import ODOMETRY, SCAN, TRANSFORMS

# Finds the topic of a message in the first bytes of a file.
TOPIC = re.compile(rb'\s*+\[?\s*+\{[^\0]*?"topic"\s*:\s*"').match

# Number of first bytes of a file in which a topic must occur; a long scan may come before it.
BEGINNING = 1 << 16

# The types of messages, by their characteristic fields; the first match counts.
KINDS = {
    SCAN: {"ranges", "angle_min"},
    TRANSFORMS: {"transforms"},
    ODOMETRY: {"pose", "twist"},
    "geometry_msgs/msg/PoseWithCovarianceStamped": {"pose.pose"},
    "geometry_msgs/msg/PoseStamped": {"pose"},
}

# Names of fields in ROS 1, and their names in ROS 2.
RENAMED = {"secs": "sec", "nsecs": "nanosec", "nsec": "nanosec"}


def is_messages(path: Path) -> bool:
    """Whether a file holds messages with topics as JSON."""
    return path.is_file() and bool(TOPIC(head_of(path, BEGINNING)))


def json_messages(lines: Iterator[bytes]) -> Iterator[tuple[str, str, int, Any]]:
    """The topic, type, time of receipt [ns] and message of each object; bad lines as text."""
    for line in lines:
        text = line.strip().rstrip(b",")
        if text in (b"", b"[", b"]"):
            continue
        try:
            values = json.loads(text)
        except (ValueError, RecursionError):
            yield "", ODOMETRY, 0, text
            continue
        for value in values if isinstance(values, list) else [values]:
            # Other requests of rosbridge, such as subscribe, hold no message.
            fields = value if isinstance(value, dict) else {}
            bodies = [each for each in fields.values() if isinstance(each, dict)]
            if "topic" in fields and bodies:
                kind = _kind_of(bodies[0])
                message = _message(bodies[0])
                yield str(value["topic"]), kind, _received(value, message), message


def message_of(data: Any, _: str) -> Any:
    """A message as it was read; raises InputError if the line is not JSON."""
    if isinstance(data, bytes):
        raise InputError("not JSON, or cut short")
    return data


def _kind_of(message: dict[str, Any]) -> str:
    """The type of a message by its fields; "" if it is of no type that is read."""
    inner = message.get("pose")
    fields = {*message, *(f"pose.{name}" for name in (inner if isinstance(inner, dict) else ()))}
    return next((kind for kind, needed in KINDS.items() if needed <= fields), "")


def _message(value: Any) -> Any:
    """A message with its fields as attributes, by their names in ROS 2."""
    if isinstance(value, dict):
        fields = {RENAMED.get(str(name), str(name)): _message(each) for name, each in value.items()}
        return SimpleNamespace(**fields)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [_message(each) for each in value]
    return value


def _received(value: dict[str, Any], message: Any) -> int:
    """When a message was received [ns], or its own stamp if that was not recorded."""
    if "log_time" in value:
        return round(float(value["log_time"]) * 1_000_000_000)
    with suppress(AttributeError, IndexError, TypeError, ValueError):
        stamp = getattr(message, "transforms", [message])[0].header.stamp
        return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return 0
