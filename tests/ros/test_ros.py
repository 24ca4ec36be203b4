"""`lrf3d ros` with real clients of ROS 2 in other processes; scripts/ros sets up what they need."""

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest
from program import lrf3d as called
from waiting import PATIENCE

from lrf3d import load_world

PYTHON = os.environ.get("LRF3D_ROS")
if PYTHON is None:
    pytest.skip("ROS 2 is not set up: scripts/ros", allow_module_level=True)

# Others who run these tests on this machine are not heard.
DOMAIN = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
}
RUNNING = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
CLIENT = Path(__file__).with_name("client.py")
ROOT = Path(__file__).parents[2]
RUNNING["env"] = os.environ | DOMAIN
ON_BASE = ["base_footprint", "laser", "left_wheel", "right_wheel"]
FRAMES = [*(["base_link", each] for each in ON_BASE), ["map", "odom"], ["odom", "base_link"]]


@pytest.fixture
def started(tmp_path):
    """Start programs in the environment of ROS, and end what is left of them."""
    running = []

    def start(*words):
        running.append(subprocess.Popen([PYTHON, *words], cwd=tmp_path, **RUNNING))
        return running[-1]

    yield start
    for each in running:
        each.kill()
        each.communicate()


@pytest.fixture
def start(started):
    """Start simulators, and read their first line."""

    def run(*words):
        simulator = started("-m", "lrf3d", "ros", *words)
        return simulator, simulator.stderr.readline()

    return run


def client(*words):
    done = subprocess.run([PYTHON, CLIENT, *words], timeout=PATIENCE, **RUNNING)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def ended(process, number=signal.SIGINT):
    process.send_signal(number)
    return process.communicate(timeout=PATIENCE)[1]


@pytest.mark.parametrize("kind", ["Twist", "TwistStamped"])
def test_a_square_driven_by_commands_closes(start, kind):
    # Half as fast as the wall clock, so that a busy machine does not drive past the corners.
    simulator, _ = start("paper_room", "--rate", "20", "--speed-up", "0.5")
    seen = client("square", kind)
    assert seen["closed"] < 0.005 and seen["off"] < 1e-9
    assert seen["steps"] == [50_000_000] and seen["unplaced"] == seen["back"] == 0
    assert seen["frames"] == FRAMES and seen["maps"] == 1
    assert (seen["beams"], seen["frame"]) == (181, "laser")
    assert "stopped" in ended(simulator) and simulator.returncode == 130


def test_services_and_poses_are_obeyed_or_refused_in_a_line(start):
    simulator, _ = start("paper_room", "--rate", "10")
    seen = client("orders", *map(str, load_world("paper_room").segments[0, :2]))
    assert seen["paused"] == 0 and 80_000_000 <= seen["stepped"] <= 100_000_000
    assert seen["placed"] == pytest.approx(0.2) and seen["kept"] == pytest.approx(3 * [0.2])
    assert seen["fast"] == 0.1 and seen["stopped"] == 0.0
    assert seen["reset"] == pytest.approx([0, 0, 0], abs=1e-9) and seen["back"] == 0
    log = ended(simulator)
    for words in (
        "'base_link': expected map or odom",
        "nan",
        "in a wall",
        "linear.y is ignored",
        "not finite",
    ):
        assert words in log


def test_the_robot_stops_when_its_driver_is_killed_and_a_stopped_client_delays_nobody(
    start, started
):
    simulator, _ = start("city", "--rate", "10", "--give", "map")
    driver, watcher = started(CLIENT, "push"), started(CLIENT, "watch", "60")
    assert client("watch", "120", "", "moves")["speed"] == 0.1
    driver.kill()
    watcher.send_signal(signal.SIGSTOP)
    client("watch", "120", "", "rests")
    seen = client("watch", "2")
    assert seen["speed"] == 0.0 and seen["moved"] == 0.0 and seen["scans"] >= 10
    assert ["map", "odom"] not in seen["frames"] and seen["maps"] == 1
    assert "the robot stops" in ended(simulator, signal.SIGTERM)


def test_a_second_clock_is_refused_and_namespaces_keep_robots_apart(start):
    start("paper_room", "--namespace", "one")
    second, line = start("corridor", "--namespace", "two")
    assert "--no-clock" in line and "ROS_DOMAIN_ID" in line and second.wait(PATIENCE) == 2
    start("corridor", "--namespace", "two", "--no-clock", "--give", "none")
    one, two = client("watch", "1", "one"), client("watch", "1", "two")
    assert (one["beams"], one["maps"]) == (181, 1) and (two["beams"], two["maps"]) == (361, 0)


def test_commands_of_a_wrong_type_are_reported(start, started):
    simulator, _ = start("paper_room")
    started(CLIENT, "push", "PoseStamped")
    assert client("watch", "3")["speed"] == 0.0
    assert "PoseStamped: expected geometry_msgs/msg/Twist" in ended(simulator)


def test_a_node_follows_walls_and_what_is_recorded_is_mapped_as_it_was_driven(
    start, started, tmp_path
):
    start("corridor", "--rate", "10", "--speed-up", "2")
    follower = started(ROOT / "examples/ros_wall_follower.py")
    assert client("record", tmp_path / "bag", "150")["scans"] >= 150
    follower.send_signal(signal.SIGINT)
    assert "segments" in follower.communicate(timeout=PATIENCE)[0]
    mapped = called("map", str(tmp_path / "bag"), "--out", str(tmp_path / "map"), "--json")
    assert json.loads(mapped.stdout)["score"]["explained"] >= 0.99
