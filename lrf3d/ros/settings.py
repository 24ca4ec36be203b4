"""How robots are served to other programs."""

from dataclasses import dataclass
from typing import Literal

from lrf3d.errors import check_names, expect
from lrf3d.geometry import number, whole_number


@dataclass(frozen=True, slots=True)
class Settings:
    """How a robot is served.

    Args:
        rate: Scans per second; that of the scenario if not given.
        speed_up: Simulated seconds per second; 0 is as fast as it goes.
        give: What is given of the truth: ``pose`` (the map and the robot in it), ``map`` or
            ``none``.
        wheels: Odometry as wheels measure it, also where the world file does not say how.
        cmd_timeout: Simulated time after the last command at which the robot stops [s]; 0 is never.
        namespace: Namespace of the topics.
        robots: Number of robots; the topics and frames of several begin with robot1, robot2, ….
        clock: Publish the simulated time.
        lines: Map while driving, and publish the line map.
        rng: Seed of the noise.
    """

    rate: float | None = None
    speed_up: float = 1.0
    give: Literal["pose", "map", "none"] = "pose"
    wheels: bool = False
    cmd_timeout: float = 0.5
    namespace: str = ""
    robots: int = 1
    clock: bool = True
    lines: bool = False
    rng: int = 0

    def __post_init__(self) -> None:
        number(self.speed_up, "speed_up")
        number(self.cmd_timeout, "cmd_timeout", "seconds")
        whole_number(self.robots, "robots")
        if self.rate is not None:
            number(self.rate, "rate", "scans per second", positive=True)
        check_names("give", [self.give], ("pose", "map", "none"))
        expect(self.namespace, str, "namespace")
