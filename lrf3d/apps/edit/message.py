"""Messages to the editor's page: a header in JSON, followed by arrays."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.apps.edit.sources import USUAL_SIZE
from lrf3d.plans.parts import KINDS
from lrf3d.plans.plan import Plan


def packed(header: Mapping[str, Any], **arrays: Any) -> bytes:
    """A message: the length of its header in four bytes, the header, and the arrays.

    The header's ``arrays`` give the type, offset and length of each; offsets are multiples of four,
    as browsers need them.
    """
    places = dict[str, Any]()
    block = bytearray()
    for name, array in arrays.items():
        places[name] = [array.dtype.str[1:], len(block), array.size]
        block += array.tobytes() + bytes(-array.nbytes % 4)
    text = json.dumps({**header, "arrays": places}, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return len(text).to_bytes(4, "little") + text + bytes(block)


def plan_message(plan: Plan, header: Mapping[str, Any]) -> bytes:
    """A plan as rows of strokes relative to an origin, with the properties of each by number."""
    parts = plan.parts
    ends = parts.segments.reshape(-1, 2)
    seen = ends if len(ends) else np.array([[0.0, 0.0], [USUAL_SIZE, 8.0]])
    origin = np.round(seen.mean(axis=0))
    names = dict[str, list[str]]()
    columns = dict[str, Any]()
    for name in ("layers", "rules", "colours"):
        found, number = np.unique(getattr(parts, name).astype(str), return_inverse=True)
        names[name] = found.tolist()
        columns[name] = number.astype(np.uint16)
    kinds = {kind: place for place, kind in enumerate(KINDS)}
    values = {
        "kind": "plan",
        **header,
        **names,
        "classes": [*KINDS],
        "origin": origin.tolist(),
        "bounds": [*seen.min(axis=0).tolist(), *seen.max(axis=0).tolist()],
        "doors": [door.opening.tolist() for door in plan.doors],
        "unit": plan.unit,
    }
    strokes = (parts.segments - np.tile(origin, 2)).astype(np.float32)
    rows = np.array([kinds[kind] for kind in parts.kinds], dtype=np.uint8)
    heights = parts.heights.astype(np.float32)
    return packed(values, strokes=strokes, kinds=rows, heights=heights, **columns)
