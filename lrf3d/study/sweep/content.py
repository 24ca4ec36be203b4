"""Digests of values by what they hold, so that they are the same in every process and place."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def digest(value: Any) -> str:
    """A digest (64 hexadecimal digits) of arrays, dataclasses, mappings, rows and plain values."""
    text = json.dumps(_plain(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def seed_of(value: Any) -> int:
    """A seed of 63 bits for numpy's SeedSequence, from what a value holds."""
    return int(digest(value)[:16], 16) >> 1


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        # Fixed order of bytes, so that machines of either kind agree; −0 is 0.
        kind = "<f8" if value.dtype.kind == "f" else "<i8"
        ordered = np.ascontiguousarray(value + 0, dtype=kind)
        return ["array", value.shape, hashlib.sha256(ordered.tobytes()).hexdigest()]
    if is_dataclass(value):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return value
