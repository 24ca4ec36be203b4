"""The beams of a scan as a mesh: the fan, single beams, and the trace where they met walls."""

from dataclasses import replace

import numpy as np
import pygltflib

from lrf3d.geometry import Float
from lrf3d.gltf.document import INDICES, VERTICES, Document, linear
from lrf3d.render.beams import BEAM_COLOUR, TRACE_COLOUR, Beams
from lrf3d.render.timeline import Timeline

FAN_COLOUR, FAN_STRENGTH = (0.98, 0.25, 0.18), 0.42
"""Colour of the fan, and its opacity at the robot, as in the film."""

REACH = 42.0
"""Range [m] at which the fan has faded to nothing: farther, it would only tint the street."""

_SINGLE_BEAMS = 46
"""About how many single beams are drawn: more would run into one red."""

_BEAM_STRENGTH = 0.62
"""Opacity of a single beam at the robot."""

_TRACE = 0.03
"""Half the height of the trace on the walls [m]."""

_CLEAR = 0.02
"""How far before the wall the trace stands [m], so that both never share a pixel."""


class ScanMeshes:
    """Makes the meshes of a run's scans, which share what they have in common."""

    def __init__(self, document: Document, timeline: Timeline) -> None:
        run = timeline.run
        self._document, self._run, self._origin = document, run, timeline.origin
        self._reach = min(run.lrf.range_max, REACH)
        self._walls = run.world.segments - np.tile(self._origin, 2)
        self._material = document.glowing("beams", translucent=True)
        step = max(1, round(run.lrf.beams / _SINGLE_BEAMS))
        self._chosen = np.arange((run.lrf.beams - 1) % step // 2, run.lrf.beams, step)
        # Single beams come first: of them every scan has as many.
        lines = np.zeros((len(self._chosen), 2), np.uint32)
        lines[:, 1] = 1 + np.arange(len(self._chosen))
        self._lines = document.array(lines.ravel(), INDICES)

    def add(self, index: int) -> tuple[int, list[float]]:
        """Add the mesh of a scan; gives its number and where it stands."""
        run, height = self._run, self._run.lrf.height
        scan = run.scan(index)
        place = np.array(scan.pose) - [*self._origin, 0.0]
        local = replace(scan, pose=place)
        beams = Beams.from_scan(local, self._walls, run.world.objects, place[:2])
        fan = beams.fan(height).reshape(-1, 3, 4)[:, 1:].reshape(-1, 4).astype(np.float64)
        ends, ranges = fan[:, :2] - beams.apex, fan[:, 3]
        single, reached = beams.ends[self._chosen] - beams.apex, beams.ranges[self._chosen]
        trace, quads = self._trace(beams)
        rows = [
            self._rows(np.zeros((1, 2)), np.zeros(1), BEAM_COLOUR, _BEAM_STRENGTH, 1.0),
            self._rows(single, reached, BEAM_COLOUR, _BEAM_STRENGTH, 1.0),
            self._rows(np.zeros((1, 2)), np.zeros(1), FAN_COLOUR, FAN_STRENGTH, 1.5),
            self._rows(ends, ranges, FAN_COLOUR, FAN_STRENGTH, 1.5),
            trace,
        ]
        # Two ends for each triangle of the fan, and one apex before them all.
        apex = 1 + len(single)
        wedges = apex + np.zeros((len(ends) // 2, 3), np.uint32)
        wedges[:, 1:] += 1 + np.arange(len(ends), dtype=np.uint32).reshape(-1, 2)
        flat = np.concatenate(rows)
        positions = flat[:, :3].astype(np.float32)
        colours = np.round(255.0 * flat[:, 3:]).astype(np.uint8)
        triangles = np.concatenate([wedges, quads + (len(flat) - len(trace))])
        small = np.uint16 if len(flat) < 65535 else np.uint32
        document = self._document
        attributes = {
            "POSITION": document.array(positions, VERTICES, bounded=True),
            "COLOR_0": document.array(colours, VERTICES, normalised=True),
        }
        indices = document.array(triangles.astype(small).ravel(), INDICES)
        lines = document.part(self._material, attributes, self._lines, mode=pygltflib.LINES)
        parts = [document.part(self._material, attributes, indices), lines]
        return document.mesh(f"scan {index}", parts), [*place[:2].tolist(), height]

    def _rows(
        self,
        ends: Float,
        ranges: Float,
        colour: tuple[float, float, float],
        strength: float,
        curve: float,
    ) -> Float:
        """Vertices (n, 7), place and colour, of beam ends that fade with their ranges [m]."""
        share = np.minimum(1.0, self._reach / np.maximum(ranges, 1e-9))
        left = np.clip(1.0 - ranges / self._reach, 0.0, 1.0)
        rows = np.zeros((len(ends), 7))
        rows[:, :2] = ends * share[:, None]
        rows[:, 3:6] = linear(np.array(colour))
        rows[:, 6] = strength * left**curve
        return rows

    def _trace(
        self, beams: Beams
    ) -> tuple[Float, np.ndarray[tuple[int, int], np.dtype[np.uint32]]]:
        """Vertices (2 · hits, 7) of a ribbon along the walls, and its triangles (t, 3)."""
        points = beams.points - beams.apex
        far = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9)
        points = points * np.maximum(0.0, 1.0 - _CLEAR / far)[:, None]
        rows = np.zeros((len(points), 2, 7))
        rows[:, :, :2] = points[:, None]
        rows[:, :, 2] = [-_TRACE, _TRACE]
        rows[:, :, 3:] = [*linear(np.array(TRACE_COLOUR[:3])).tolist(), TRACE_COLOUR[3]]
        first = 2 * (np.cumsum(beams.hits) - 1)[np.flatnonzero(beams.joined)]
        quads = first[:, None] + np.array([[0, 2, 3, 0, 3, 1]])
        return rows.reshape(-1, 7), quads.reshape(-1, 3).astype(np.uint32)
