"""SLAM on a recorded log: the input is a log, the output its poses, its map and the summary."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.io import LaserLog
from lrf3d.laser.free_space import distinct_poses, free_cells
from lrf3d.progress import Progress
from lrf3d.run import Run
from lrf3d.scoring import Relations, TrajectoryScore, score_trajectory
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.log import LogSolution, run_of, solve_recording
from lrf3d.slam.repair import NAMED
from lrf3d.text import counted
from lrf3d.world.free_cells import FreeCells


@dataclass(frozen=True, eq=False)
class SlamLog:
    """A log and the result of SLAM.

    Args:
        log: The log.
        solution: The poses.
        score: The error of the trajectory against known relations; None without any.
    """

    log: LaserLog
    solution: LogSolution
    score: TrajectoryScore | None = None

    @cached_property
    def run(self) -> Run:
        """The recorded drive as a run, in the walls that it mapped."""
        return run_of(self.log, self.solution)

    def trajectory(self) -> tuple[Float, Float]:
        """Times (n,) [s] and poses (n, 3) of the robot at the odometry lines, as logged."""
        times = self.log.times if self.log.wheels is None else self.log.wheels.times
        return times, self.solution.line_poses

    def free_cells(self) -> FreeCells:
        """The cells that the key scans, from which the map was built, show to be free."""
        keys = self.solution.slam.key_scans
        chosen = keys[distinct_poses(self.run.trajectory.poses[keys])]
        return free_cells([self.run.scan(number) for number in chosen.tolist()])

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        solution, tracked = self.solution, self.solution.slam.tracked
        repairs, biases = solution.repairs, solution.slam.wheels.biases.tolist()
        return {
            "name": self.log.name,
            "log": {
                "scans": len(self.log),
                "beams": len(self.log.scans[0].ranges),
                "odometry_lines": len(solution.line_poses),
                "odometry": self._odometry,
                "put_in_order": repairs.put_in_order,
                "doubled_scans": repairs.doubled_scans,
                "doubled_odometry_lines": repairs.doubled_lines,
                "odometry_jumps": len(repairs.jumps),
                "first_odometry_jumps": list(repairs.jumps[:NAMED]),
                "gaps": len(repairs.gaps),
                "first_gaps": list(repairs.gaps[:NAMED]),
                "scans_without_odometry": repairs.scans_without_odometry,
                "stamps_not_rising": repairs.stamps_not_rising,
                "bad_lines": self.log.bad_count,
            },
            "wheels": {
                "lag_lines": solution.lag,
                "turn_share": biases[0],
                "turn_rad_per_m": biases[1],
                "way_share": biases[2],
                "solved_times": solution.passes,
            },
            "slam": {
                "length_m": self.run.trajectory.length,
                "key_scans": len(solution.slam.key_scans),
                "loop_closures": len(solution.closures),
                "loop_closures_dropped": len(solution.slam.unconfirmed_closures),
                "scans_by_odometry_alone": sum(not scan.matched for scan in tracked[1:]),
                "scans_with_a_weak_direction": sum(scan.weak for scan in tracked[1:]),
            },
            "self_check": {
                "passed": solution.check.passed,
                "violation": solution.check.violation,
                "worst_violation": solution.check.worst_violation,
                "worst_scans": list(solution.check.worst_scans),
                "key_scans_compared": solution.check.compared,
            },
            "map": {"segments": len(self.run.map), "objects": self.run.map.object_count},
            "score": None if self.score is None else self.score.as_dict(),
            "milliseconds_a_scan": solution.milliseconds,
        }

    @property
    def _odometry(self) -> str:
        return "the poses of the scans" if self.log.wheels is None else "ODOM lines"

    def rows(self) -> list[tuple[str, str]]:
        """The figures as a printed table."""
        summary = self.summary()
        log, wheels, slam = summary["log"], summary["wheels"], summary["slam"]
        scans = f"{counted(log['scans'], 'scan')} of {counted(log['beams'], 'beam')}"
        bad = counted(log["bad_lines"], "bad line")
        rows = [("log", f"{scans}, {counted(log['odometry_lines'], 'pose')} by odometry, {bad}")]
        rows += [("", f"first bad {line}") for line in self.log.bad_lines[:1]]
        rows += [("", sentence) for sentence in self.solution.repairs.sentences()]
        text = f"lag {wheels['lag_lines']:.2f} lines, turn {wheels['turn_rad_per_m']:+.4f} rad/m"
        rows.append(("wheels", text))
        if wheels["solved_times"] > 1:
            turn, distance = 1.0 + wheels["turn_share"], 1.0 + wheels["way_share"]
            text = f"scans show {turn:.2f} times their turns and {distance:.2f} times their way"
            rows.append(("", f"{text}: solved {wheels['solved_times']} times to learn that"))
        closed = counted(slam["loop_closures"], "loop closure")
        if slam["loop_closures_dropped"]:
            closed += f", {slam['loop_closures_dropped']} more dropped"
        text = f"{slam['length_m']:.0f} m, {counted(slam['key_scans'], 'key scan')}, {closed}"
        rows.append(("drive", text))
        if slam["scans_by_odometry_alone"]:
            lost = counted(slam["scans_by_odometry_alone"], "scan")
            rows.append(("", f"{lost} matched nothing: placed by odometry"))
        rows.append(("map", self.run.map.counts))
        rows += [("", sentence) for sentence in self.solution.check.sentences()]
        if self.score is not None:
            score = self.score
            text = f"{score.translation_mean:.4f} ± {score.translation_std:.4f} m,"
            text += f" {score.rotation_mean:.2f} ± {score.rotation_std:.2f}° over {score.relations}"
            rows.append(("relations", text))
        rows.append(("time", f"{summary['milliseconds_a_scan']:.2f} ms a scan"))
        return rows


def slam_log(
    log: LaserLog,
    *,
    key_distance: float = KEY_DISTANCE,
    relations: Relations | None = None,
    progress: Progress = lambda done, total: None,
) -> SlamLog:
    """Find the poses and the map of a recorded drive from its scans and its odometry.

    Args:
        log: The log.
        key_distance: Distance driven from one key scan to the next [m].
        relations: Known relative poses between odometry lines, to score by.
        progress: Called with the number of finished scans, and of all.

    Raises:
        InputError: The log is too short, its scans differ in their beams, or the relations are of
            another log.
    """
    solution = solve_recording(log, key_distance=key_distance, progress=progress)
    score = None if relations is None else score_trajectory(solution.line_poses, relations)
    return SlamLog(log, solution, score)


def draw_slam_log(solved: SlamLog, path: Path) -> None:
    """Draw the map over the points of its key scans, the path and the closures, to a file.

    Raises:
        OutputError: The file cannot be written.
    """
    from lrf3d.render.figures import draw_map

    keys = solved.solution.slam.key_scans
    draw_map(
        solved.run.map,
        path,
        points=np.vstack([solved.run.scan(number).points() for number in keys.tolist()]),
        poses=solved.run.trajectory.poses,
        estimate=solved.run.estimate,
        title=solved.log.name,
    )
