"""A run as the page wants it: one block of plain arrays, and where each stands in it."""

from typing import Any

import numpy as np

from lrf3d.run import Run
from lrf3d.scene.timeline import Timeline, drive_keys, mover_keys, scan_times
from lrf3d.scene.trail_and_map import DrawnMap
from lrf3d.view.scene import joined_beams

_ALIGNMENT = 4
"""Bytes that the start of every array is a multiple of."""


def pack_run(run: Run) -> tuple[bytes, dict[str, Any]]:
    """All that moves in a run, in its world's local frame.

    Returns:
        The arrays one after the other, and their description for the page: type, first byte and
        length of each, the legs of the way that are jumps, and the time that the run starts at.
    """
    # A scene plays as fast as the robot drove.
    timeline = Timeline(run, playback=1.0)
    keys = drive_keys(timeline)
    begins, ends = scan_times(timeline)
    # The first of them is empty, so that there is one also where a run has no map.
    maps = [
        DrawnMap.from_snapshot(run, number, timeline.origin) for number in range(-1, len(run.maps))
    ]
    stage_times = run.trajectory.times[list(run.stages)]
    ways = [mover_keys(mover, timeline) for mover in run.movers]
    arrays = {
        "keyTimes": (keys.times, np.float32),
        "keyPoses": (keys.poses, np.float32),
        "begins": (begins - timeline.start, np.float32),
        "ends": (ends - timeline.start, np.float32),
        "poses": (run.trajectory.poses - [*timeline.origin, 0.0], np.float32),
        "ranges": (run.ranges, np.float32),
        "stageTimes": (stage_times - timeline.start, np.float32),
        "stageSizes": ([len(stage) for stage in run.maps], np.int32),
        "stageObjects": ([stage.object_count for stage in run.maps], np.int32),
        "segments": (np.concatenate([drawn.segments for drawn in maps]), np.float32),
        "colours": (np.concatenate([drawn.colour_bytes for drawn in maps]), np.uint8),
        "moverSizes": ([len(times) for times, _ in ways], np.int32),
        "moverTimes": (np.concatenate([*(times for times, _ in ways), []]), np.float32),
        "moverPoses": (
            np.concatenate([*(poses for _, poses in ways), np.empty((0, 3))]),
            np.float32,
        ),
        "joined": (joined_beams(run.ranges, run.walls), np.uint8),
    }
    block, layout = bytearray(), {}
    for name, (values, kind) in arrays.items():
        array = np.asarray(values, kind).ravel()
        layout[name] = (array.dtype.name, len(block), len(array))
        block += array.tobytes()
        block += bytes(-len(block) % _ALIGNMENT)
    told = {
        "layout": layout,
        "jumps": np.flatnonzero(keys.set_down).tolist(),
        "start": timeline.start,
    }
    return bytes(block), told
