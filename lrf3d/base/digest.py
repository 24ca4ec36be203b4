"""Digests: short texts that are equal for equal contents, on every machine."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import FunctionType
from typing import Any

import numpy as np


def digest(value: Any) -> str:
    """A digest (64 hexadecimal digits) of arrays, dataclasses, mappings, rows and plain values."""
    text = json.dumps(_plain(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def seed_of(value: Any) -> int:
    """A seed of 63 bits for NumPy's SeedSequence, from the contents of a value."""
    return int(digest(value)[:16], 16) >> 1


def name_of(part: Any) -> str:
    """The repr of an object with its class, or the class alone if the repr is only an address."""
    if isinstance(part, type | FunctionType):
        return f"{part.__module__}:{part.__qualname__}"
    text = repr(part)
    kind = f"{type(part).__module__}:{type(part).__qualname__}"
    return kind if " at 0x" in text else f"{kind} {text}"


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        # A fixed byte order makes the digest the same on all machines; −0 counts as 0.
        kind = "<f8" if value.dtype.kind == "f" else "<i8"
        ordered = np.ascontiguousarray(value + 0, dtype=kind)
        return ["array", value.shape, hashlib.sha256(ordered.tobytes()).hexdigest()]
    if is_dataclass(value):
        # A field that the repr hides counts only if it differs from its default.
        value = {
            each.name: getattr(value, each.name)
            for each in fields(value)
            if each.repr or getattr(value, each.name) != each.default
        }
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return value
