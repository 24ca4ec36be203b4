"""A run as glTF: the robot drives, and its scans and map snapshots follow each other.

Every player of glTF can move, turn and scale nodes, and few can do more. So each scan and each
stage of the map is a node of its own, which has its size while it is to be seen and none
otherwise, and each straight piece of the trail is one that grows while it is driven.
"""

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pygltflib

from lrf3d.errors import InputError
from lrf3d.geometry import Float, quad_indices
from lrf3d.gltf.document import INDICES, VERTICES, Document, linear
from lrf3d.gltf.estimate import add_estimate
from lrf3d.gltf.showing import Showing
from lrf3d.gltf.stage import (
    add_chase_camera,
    add_obstacles,
    add_robot,
    add_stage,
    drive_obstacles,
    new_document,
)
from lrf3d.gltf.trail import add_trail
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.beams import DrawnBeams, drawn_beams
from lrf3d.scene.map_bands import WallTops
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import DriveKeys, Timeline, drive_keys, scan_times
from lrf3d.scene.trail_and_map import DrawnMap
from lrf3d.scene.turns import WallOptics

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle


def run_glb(run: Run, *, every: int = 1) -> bytes:
    """A run as a GLB file with one animation.

    Args:
        run: The run.
        every: Each scan of this many is kept, for smaller files of long runs.

    Raises:
        InputError: ``every`` is less than 1.
    """
    if every < 1:
        raise InputError(f"every {every}: expected a whole number from 1")
    # A scene plays as fast as the robot drove.
    timeline = Timeline(run, playback=1.0)
    structures = Structures.from_run(run)
    document = new_document(run.world.name, structures)
    add_stage(document, structures)
    keys = drive_keys(timeline)
    _add_robot(document, keys, run, structures)
    drive_obstacles(document, timeline)
    _add_scans(document, timeline, every)
    _add_maps(document, timeline)
    trail = look.TRAIL_COLOUR, look.TRAIL_WIDTH, look.TRAIL_HEIGHT
    if run.knows_truth:
        add_trail(document, keys, "trail", *trail)
    add_estimate(document, timeline)
    return document.glb()


def still_glb(
    name: str,
    structures: Structures,
    laser_height: float,
    obstacles: "tuple[DynamicObstacle, ...]" = (),
) -> bytes:
    """A world as a GLB file, with the robot and dynamic obstacles, all at the frame's origin."""
    document = new_document(name, structures)
    add_stage(document, structures)
    add_robot(document, laser_height)
    add_obstacles(document, obstacles)
    return document.glb()


def _add_robot(document: Document, keys: DriveKeys, run: Run, structures: Structures) -> None:
    """The robot, which drives, and a camera that looks over its shoulder."""
    robot = add_robot(document, run.lrf.height)
    document.drive(robot, keys.times, keys.poses)
    add_chase_camera(document, robot, structures)


def _add_scans(document: Document, timeline: Timeline, every: int) -> None:
    """The beams of each scan, seen while it is the nearest in time."""
    run = timeline.run
    begins, ends = scan_times(timeline, every)
    meshes = ScanMeshes(document, timeline)
    showing = Showing(document, timeline.start, timeline.end)
    group = document.node("beams", document.root)
    scans = range(0, len(run), every)
    for scan, begin, end in zip(scans, begins.tolist(), ends.tolist(), strict=True):
        mesh, place = meshes.add(scan)
        node = document.node(f"scan {scan}", group, mesh=mesh, translation=place)
        showing.between(node, begin, end)


def _add_maps(document: Document, timeline: Timeline) -> None:
    """Each map snapshot as bands along the walls, each object in its colour."""
    run = timeline.run
    material = document.glowing("map")
    showing = Showing(document, timeline.start, timeline.end)
    group = document.node("map", document.root)
    begins = run.trajectory.times[list(run.snapshot_scans)].tolist()
    times = pairwise([*begins, timeline.end])
    tops = WallTops(run.world.segments - np.tile(timeline.origin, 2), run.world.heights)
    for stage, objects, (begin, end) in zip(run.maps, run.lasting_objects, times, strict=True):
        if not len(stage):
            continue
        drawn = DrawnMap.from_map(stage, objects, timeline.origin)
        positions = drawn.bands(tops.bands(drawn.segments)).reshape(-1, 3)
        colours = np.full((len(stage), 4), 255, np.uint8)
        colours[:, :3] = np.round(255.0 * linear(drawn.colours))
        colours = np.repeat(colours, len(positions) // len(stage), axis=0)
        attributes = {
            "POSITION": document.array(positions, VERTICES, bounded=True),
            "COLOR_0": document.array(colours, VERTICES, normalised=True),
        }
        indices = document.array(quad_indices(len(positions) // 4), INDICES)
        mesh = document.mesh("map", [document.part(material, attributes, indices)])
        node = document.node(f"map of {len(stage)} segments", group, mesh=mesh)
        showing.between(node, begin, end)


_BEAM = look.BEAM_COLOUR, look.BEAM_STRENGTH, 1.0
_FAN = look.FAN_COLOUR, look.FAN_STRENGTH, look.FAN_CURVE
"""Colour, opacity at the robot, and the power that it fades with."""


class ScanMeshes:
    """Makes the meshes of a run's scans, which share what they have in common."""

    def __init__(self, document: Document, timeline: Timeline) -> None:
        run = timeline.run
        self._document, self._run, self._origin = document, run, timeline.origin
        self._reach = min(run.lrf.range_max, look.BEAM_REACH)
        self._walls = run.world.segments - np.tile(self._origin, 2)
        self._material = document.glowing("beams", translucent=True)
        self._chosen = drawn_beams(run.lrf.beams)
        self._optics = WallOptics.of(run.world)
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
        beams = DrawnBeams.from_scan(
            local, self._walls, run.world.objects, place[:2], optics=self._optics
        )
        fan = beams.fan(height).reshape(-1, 3, 5)[:, 1:].reshape(-1, 5).astype(np.float64)
        ends, ranges = fan[:, :2] - beams.apex, fan[:, 3]
        single, reached = beams.ends[self._chosen] - beams.apex, beams.ranges[self._chosen]
        trace, quads = self._trace(beams)
        rows = [
            self._rows(np.zeros((1, 2)), np.zeros(1), *_BEAM),
            self._rows(single, reached, *_BEAM, beams.shares[self._chosen]),
            self._rows(np.zeros((1, 2)), np.zeros(1), *_FAN),
            self._rows(ends, ranges, *_FAN, fan[:, 4]),
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
        shares: Float | float = 1.0,
    ) -> Float:
        """Vertices (n, 7), place and colour, of beam ends that fade with their ranges [m].

        Shares (n,) are what of their opacity is left.
        """
        share = np.minimum(1.0, self._reach / np.maximum(ranges, 1e-9))
        left = np.clip(1.0 - ranges / self._reach, 0.0, 1.0)
        rows = np.zeros((len(ends), 7))
        rows[:, :2] = ends * share[:, None]
        rows[:, 3:6] = linear(np.array(colour))
        rows[:, 6] = strength * shares * left**curve
        return rows

    def _trace(
        self, beams: DrawnBeams
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
