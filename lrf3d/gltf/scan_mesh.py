"""The beams of a scan as a mesh: the fan, single beams, and the trace where they met walls."""

from dataclasses import replace

import numpy as np
import pygltflib

from lrf3d.geometry import Float
from lrf3d.gltf.document import INDICES, VERTICES, Document, linear
from lrf3d.scene import look
from lrf3d.scene.beams import Beams, drawn_beams
from lrf3d.scene.timeline import Timeline

_BEAM = look.BEAM_COLOUR, look.BEAM_STRENGTH, 1.0
_FAN = look.FAN_COLOUR, look.FAN_STRENGTH, look.FAN_CURVE
"""Colour, opacity at the robot, and the power that it fades with."""


class ScanMeshes:
    """Makes the meshes of a run's scans, which share what they have in common."""

    def __init__(self, document: Document, timeline: Timeline) -> None:
        run = timeline.run
        self._document, self._run, self._origin = document, run, timeline.origin
        self._reach = min(run.lrf.range_max, look.REACH)
        self._walls = run.world.segments - np.tile(self._origin, 2)
        self._material = document.glowing("beams", translucent=True)
        self._chosen = drawn_beams(run.lrf.beams)
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
            self._rows(np.zeros((1, 2)), np.zeros(1), *_BEAM),
            self._rows(single, reached, *_BEAM),
            self._rows(np.zeros((1, 2)), np.zeros(1), *_FAN),
            self._rows(ends, ranges, *_FAN),
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
        points = points * np.maximum(0.0, 1.0 - look.TRACE_GAP / far)[:, None]
        rows = np.zeros((len(points), 2, 7))
        rows[:, :, :2] = points[:, None]
        rows[:, :, 2] = [-0.5 * look.TRACE_HEIGHT, 0.5 * look.TRACE_HEIGHT]
        rows[:, :, 3:] = [*linear(np.array(look.TRACE_COLOUR)), look.TRACE_STRENGTH]
        first = 2 * (np.cumsum(beams.hits) - 1)[np.flatnonzero(beams.joined)]
        quads = first[:, None] + np.array([[0, 2, 3, 0, 3, 1]])
        return rows.reshape(-1, 7), quads.reshape(-1, 3).astype(np.uint32)
