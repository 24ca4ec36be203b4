"""The environments of Gymnasium."""

import importlib
import sys
import warnings
from dataclasses import replace

import gymnasium
import matplotlib
import numpy as np
import pytest
import shapely
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from matplotlib import pyplot

import lrf3d.gym
from lrf3d import InputError, Scenario, load_scenario
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.skyline import Conditions
from lrf3d.geometry.pose import compose
from lrf3d.gym import DriveEnv, DriveVectorEnv
from lrf3d.studio.render import film
from lrf3d.studio.render.gl import gl_available

CORRIDOR = load_scenario("corridor")


def drives(count, steps=120, seed=5, **settings):
    """What some robots see, earn and come to, with actions that are drawn."""
    envs = DriveVectorEnv(count, CORRIDOR, **settings)
    seen = [envs.reset(seed=seed)[0]]
    rng, rest = np.random.default_rng(0), []
    for _ in range(steps):
        observation, *others, _ = envs.step(rng.uniform(-1.0, 1.0, (count, 2)))
        seen.append(observation)
        rest.append(others)
    return seen, rest


def test_the_checker_of_gymnasium_finds_nothing():
    env = gymnasium.make("lrf3d/Drive-v0", world=CORRIDOR, sigma=0.03)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)


def test_the_same_seed_repeats_bit_for_bit_and_another_does_not():
    one, rest = drives(7, sigma=0.05)
    other, rest_again = drives(7, sigma=0.05)
    for first, second in zip(one, other, strict=True):
        assert all(np.array_equal(first[name], second[name]) for name in first)
    for first, second in zip(rest, rest_again, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    third, _ = drives(7, sigma=0.05, seed=6)
    assert not np.array_equal(one[0]["ranges"], third[0]["ranges"])


def test_the_single_environment_is_the_vector_environment_with_one_robot():
    env, envs = DriveEnv(CORRIDOR, sigma=0.02), DriveVectorEnv(1, CORRIDOR, sigma=0.02)
    seen, (seen_by_all, _) = env.reset(seed=9)[0], envs.reset(seed=9)
    rng = np.random.default_rng(1)
    for _ in range(50):
        assert all(np.array_equal(seen[name], seen_by_all[name][0]) for name in seen)
        action = rng.uniform(-1.0, 1.0, 2)
        seen, reward, ended, cut, _ = env.step(action)
        seen_by_all, rewards, ends, cuts, _ = envs.step(action[None])
        assert (reward, ended, cut) == (rewards[0], ends[0], cuts[0])
        if ended:
            break


def test_what_is_seen_is_finite_and_lies_in_its_space():
    envs = DriveVectorEnv(5, "city")
    seen, _ = envs.reset(seed=2)
    for _ in range(30):
        assert envs.observation_space.contains(seen)
        assert all(np.isfinite(value).all() for value in seen.values())
        seen, *_ = envs.step(envs.action_space.sample())
    _, truth, walls = envs.scan
    lost = np.isinf(truth)
    assert lost.any() and (seen["ranges"][lost] == 80.0).all()
    assert (walls[lost] == -1).all()
    measured = DriveVectorEnv(5, "city", sigma=300.0).reset(seed=2)[0]["ranges"]
    assert (measured == 0.0).any() and (measured >= 0.0).all()


def test_ranges_are_those_of_the_caster():
    seen, info = DriveEnv(CORRIDOR, sigma=0.0).reset(seed=4)
    scan = lrf3d.PlanarCaster(CORRIDOR.world).cast(CORRIDOR.lrf, info["pose"])
    assert np.array_equal(seen["ranges"], scan.ranges.astype(np.float32))
    x, y, theta = info["pose"]
    distance, cos, sin = seen["goal"].astype(float)
    goal = [x + distance * np.cos(theta + np.arctan2(sin, cos)),
            y + distance * np.sin(theta + np.arctan2(sin, cos))]  # fmt: skip
    assert goal == pytest.approx(info["goal"], abs=1e-5)


def test_a_robot_that_drives_to_its_goal_is_rewarded_and_ends_there():
    env = DriveEnv(CORRIDOR)
    _, info = env.reset(seed=0, options={"pose": (2.0, 1.3, 0.0), "goal": (8.0, 1.3)})
    earned, steps = 0.0, 0
    while True:
        _, reward, ended, cut, info = env.step(np.array([1.0, 0.0]))
        earned, steps = earned + reward, steps + 1
        if ended or cut:
            break
    assert ended and not cut and info["reached"] and not info["collided"]
    away = np.hypot(*(info["goal"] - info["pose"][:2]))
    assert away < 0.5
    assert earned == pytest.approx(6.0 - away + 10.0 - 0.01 * steps)


def test_an_action_that_is_no_number_is_refused_and_the_next_ones_drive_on():
    envs = DriveVectorEnv(3, CORRIDOR)
    envs.reset(seed=0)
    with pytest.raises(lrf3d.InputError, match=r"action of robot 1: \[nan, 0\.0\]"):
        envs.step(np.array([[0.5, 0.0], [np.nan, 0.0], [0.5, 0.0]]))
    for _ in range(3):
        _, rewards, *_ = envs.step(np.full((3, 2), 0.2))
        assert np.isfinite(rewards).all() and np.isfinite(envs.poses).all()
    env = DriveEnv(CORRIDOR)
    for name, value in (("goal", (np.nan, 1.0)), ("goal", (1.0,)), ("pose", (0.0, np.inf, 0.0))):
        with pytest.raises(lrf3d.InputError, match=name):
            env.reset(seed=0, options={name: value})


def test_robots_start_clear_of_walls_and_their_goals_lie_within_reach():
    task = DriveVectorEnv(300, CORRIDOR)
    task.reset(seed=3)
    walls = shapely.multilinestrings(CORRIDOR.world.segments.reshape(-1, 2, 2))
    for places in (task.poses[:, :2], task.goals):
        assert shapely.distance(walls, shapely.points(places)).min() >= CORRIDOR.radius
    assert 5.0 <= task.distances().min() and task.distances().max() <= 20.0


@pytest.mark.parametrize("renderer", ["gl", "embree"])
def test_pictures_show_the_goal(renderer, monkeypatch):
    if renderer == "gl" and not gl_available():
        pytest.skip("no OpenGL on this machine")
    monkeypatch.setattr(film, "choose_renderer", lambda wanted: renderer)
    env = DriveEnv(CORRIDOR, render_mode="rgb_array", size=(320, 180), view="chase")
    pose = np.array(env.robots.scenario.trajectory().poses[0])
    ahead = pose[:2] + 1.5 * np.array([np.cos(pose[2]), np.sin(pose[2])])
    green = []
    for goal in (ahead, ahead + 500.0):
        env.reset(seed=3, options={"pose": pose, "goal": goal})
        red, middle, blue = np.moveaxis(env.render()[:, :200].astype(int), -1, 0)
        green.append(int(((middle > red + 25) & (middle > blue + 25)).sum()))
    assert green[0] > 40 and green[1] == 0


def test_each_step_is_shown_in_a_window_which_stays_closed_once_it_is(monkeypatch):
    pyplot.switch_backend("agg")
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "screen")
    monkeypatch.setattr(pyplot, "show", lambda *, block: None)
    env = DriveEnv("paper_room", render_mode="human", size=(160, 90))
    env.reset(seed=3)
    seen = []
    for _ in range(2):
        env.step(np.array([0.1, 0.3]))
        figure = pyplot.figure("lrf3d")
        figure.canvas.draw()
        seen.append(np.asarray(figure.canvas.buffer_rgba()).copy())
    assert seen[0].shape == (90, 160, 4) and not np.array_equal(*seen)
    assert env.render() is None
    pyplot.close("lrf3d")
    env.step(np.array([0.1, 0.0]))
    assert not pyplot.fignum_exists("lrf3d")
    env.close()
    env.close()


def test_without_a_screen_the_fix_is_named(monkeypatch):
    monkeypatch.setattr(matplotlib, "get_backend", lambda: "agg")
    said = r"draws with agg; .* python3-tk.*rgb_array"
    with pytest.raises(lrf3d.MissingLibraryError, match=said):
        DriveEnv("paper_room", render_mode="human")


def test_without_gymnasium_the_error_names_the_command_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "lrf3d.gym")
    with pytest.raises(lrf3d.MissingLibraryError, match=r"pip install -e .*\[gym\]"):
        importlib.import_module("lrf3d.gym")


def test_settings_that_make_no_sense_are_refused():
    for settings in ({"sigma": -1.0}, {"max_steps": 0}, {"render_mode": "ansi"}):
        for made in (DriveEnv, lambda **settings: DriveVectorEnv(2, **settings)):
            with pytest.raises(lrf3d.InputError, match=next(iter(settings))):
                made(world=CORRIDOR, **settings)


def own_noise(scan, rng):
    """Longer ranges where the laser stands farther to the left: it reads the pose of its scan."""
    return replace(scan, ranges=scan.ranges * (1.0 + rng.random() * abs(scan.pose.y)))


@pytest.mark.parametrize("noise", [lrf3d.ProportionalNoise(0.5), own_noise])
def test_the_noise_is_that_of_the_scenario(noise):
    scenario = CORRIDOR.changed(noise=noise)
    envs, exact = DriveVectorEnv(3, scenario), DriveVectorEnv(3, CORRIDOR, sigma=0.0)
    # The draws that follow those of the places are those of any simulation of the scenario.
    truth, draws = exact.reset(seed=4)[0], exact.np_random
    seen, _ = envs.reset(seed=4)
    assert np.array_equal(envs.poses, exact.poses)
    assert not np.array_equal(seen["ranges"], truth["ranges"])
    caster, lrf = lrf3d.PlanarCaster(scenario.world), scenario.lrf
    for ranges, pose in zip(seen["ranges"], envs.poses, strict=True):
        measured = noise(caster.cast(lrf, pose), draws).ranges
        assert np.array_equal(ranges, np.clip(measured, 0, lrf.range_max, dtype=np.float32))


def test_dynamic_obstacles_are_seen_and_run_into():
    walk = lrf3d.Trajectory([0.0, 100.0], [(6.0, 1.3, 0.0), (6.0, 1.3, 0.0)])
    cart = lrf3d.DynamicObstacle([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]], walk)
    scenario = CORRIDOR.changed(obstacles=(cart,))
    env = DriveEnv(scenario, sigma=0.0)
    seen, _ = env.reset(seed=0, options={"pose": (4.0, 1.3, 0.0), "goal": (8.0, 1.3)})
    assert seen["ranges"][np.argmin(np.abs(scenario.lrf.angles))] == pytest.approx(1.7)
    for _ in range(50):
        _, reward, ended, _, info = env.step(np.array([1.0, 0.0]))
        if ended:
            break
    assert reward == pytest.approx(-10.01)
    assert info["collided"] and info["pose"][0] == pytest.approx(5.7 - scenario.radius)


SQUARE = lrf3d.World([[-9.0, -9, 9, -9], [9, -9, 9, 9], [9, 9, -9, 9], [-9, 9, -9, -9]])


def test_robots_that_are_together_see_and_touch_each_other():
    lasers = {"lrf": lrf3d.LaserRangeFinder(-np.pi, np.pi, 73, range_max=20.0)}
    scenario = Scenario(SQUARE, **lasers, noise=lrf3d.ProportionalNoise(0.0), radius=0.5, speed=1.0)
    both = DriveVectorEnv(2, scenario, together=True)
    both.reset(seed=0)
    assert np.hypot(*(both.poses[0] - both.poses[1])[:2]) > 1.0
    both.poses[:] = [(0.0, 0, 0), (3.0, 0, np.pi)]
    still = np.zeros((2, 2))
    seen, *_ = both.step(still)
    assert seen["ranges"][:, 36] == pytest.approx([2.5, 2.5])
    for gap in (2.0, 1.5, 1.0, 0.5):
        seen, _, ended, *_ = both.step(np.array([[1.0, 0], [1.0, 0]]))
        assert seen["ranges"][:, 36] == pytest.approx([gap, gap]) and not ended.any()
    # Now they stand next to each other, and would overlap after the next step.
    infos = both.step(np.array([[1.0, 0], [1.0, 0]]))[4]
    assert infos["collided"].all() and both.poses[:, 0] == pytest.approx([1.0, 2.0])
    alone = DriveVectorEnv(2, scenario)
    alone.reset(seed=0)
    alone.poses[:] = [(0.0, 0, 0), (3.0, 0, np.pi)]
    assert alone.step(still)[0]["ranges"][0, 36] == pytest.approx(9.0)


def test_several_lasers_are_one_observation_and_moving_obstacles_are_touched_on_the_way():
    front = lrf3d.LaserRangeFinder(0.0, 0.0, 1, range_max=20.0, mount=(0.5, 0, 0), name="front")
    rear = lrf3d.LaserRangeFinder(0.0, 0.0, 1, range_max=8.0, mount=(-0.5, 0, np.pi), name="rear")
    silent = lrf3d.ProportionalNoise(0.0)
    # The ball is past the robot at both ends of the step, and goes through it in between.
    ball = lrf3d.Trajectory([0.0, 0.25], [(0.0, -2.0, 0), (0.0, 2.0, 0)])
    thrown = lrf3d.DynamicObstacle([[-0.1, -0.1], [0.1, -0.1], [0.0, 0.1]], ball)
    scenario = Scenario(SQUARE, front, silent, further=((rear, silent),), obstacles=(thrown,))
    env = DriveVectorEnv(1, scenario)
    observation, _ = env.reset(seed=1, options={"pose": (0.0, 0.0, 0.0), "goal": (8.0, 8.0)})
    assert observation["ranges"].tolist() == [[8.5, 8.0]]
    assert env.observation_space.contains(observation)
    assert env.step(np.zeros((1, 2)))[4]["collided"].all()


def test_a_specification_has_the_steps_after_which_episodes_are_cut_off():
    for steps in (None, 700):
        settings = {} if steps is None else {"max_steps": steps}
        for make in (gymnasium.make, gymnasium.make_vec):
            env = make("lrf3d/Drive-v0", world="paper_room", **settings)
            assert env.spec.max_episode_steps == (steps or 500)


def test_seeds_of_robots_repeat_and_a_mask_places_some_alone():
    env = DriveVectorEnv(3, "paper_room")
    first = env.reset(seed=[1, 2, 3])[0]
    poses = env.poses.copy()
    assert np.array_equal(first["ranges"], env.reset(seed=[1, 2, 3])[0]["ranges"])
    env.reset(options={"reset_mask": np.array([False, True, False])})
    assert (env.poses == poses).all(axis=1).tolist() == [True, False, True]
    for wrong in ({"seed": [1, 2]}, {"options": {"reset_mask": [1, 0, 0]}}):
        with pytest.raises(InputError, match="3"):
            env.reset(**wrong)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_robots_are_placed_again_when_the_mode_says(mode):
    env = DriveVectorEnv(2, "paper_room", max_steps=3, autoreset=mode)
    assert env.metadata["autoreset_mode"] is mode
    env.reset(seed=0)
    starts = env.poses.copy()
    moved, cuts = [], []
    for _ in range(4):
        _, rewards, ended, cut, infos = env.step(np.tile([0.0, 0.2], (2, 1)))
        moved.append((env.poses[:, :2] != starts[:, :2]).any())
        assert not ended.any() and not (moved[-1] and mode.name == "NEXT_STEP" and rewards.any())
        cuts.append(bool(cut.all()))
        if cuts[-1]:
            assert ("final_obs" in infos) == (mode is AutoresetMode.SAME_STEP)
    assert cuts == [False, False, True, False]
    placed = {"NEXT_STEP": [False, True], "SAME_STEP": [True, True], "DISABLED": [False, False]}
    assert moved[2:] == placed[mode.name]


def test_robots_are_agents_of_pettingzoo():
    pytest.importorskip("pettingzoo")
    from pettingzoo.test import parallel_api_test

    from lrf3d.gym.parallel import parallel_env

    parallel_api_test(parallel_env(3, "paper_room", max_steps=20), num_cycles=50)


@pytest.mark.parametrize("crowded", [False, True])
def test_lidars_and_depth_cameras_are_observed_as_they_are_cast(crowded):
    # One of the walls is lower than the lidar, which stands in its outline or outside.
    yard = lrf3d.World(
        [[-9, -9, 9, -9], [9, -9, 9, 9], [9, 9, -9, 9], [-9, 9, -9, -9],
         [-2, -2, 2, -2], [2, -2, 2, 2], [2, 2, -2, 2], [-2, 2, -2, -2]],
        objects=[0] * 4 + [1] * 4, heights=[2.5] * 4 + [0.4] * 4,
    )  # fmt: skip
    lidar = lrf3d.Lidar([0.2, 0.0, -0.2], columns=36, mount=(0.1, 0, 0.8), range_min=1.0)
    camera = lrf3d.DepthCamera(8, 6, fov=1.0, mount=(0, 0, 0.6))
    lrf = lrf3d.LaserRangeFinder(beams=3, range_max=30.0)
    moving = lrf3d.DynamicObstacle(
        [[0, 0], [1, 0], [0, 1]], lrf3d.Trajectory([0.0], [(5, 5, 0)]), 1.5
    )
    world = Scenario(yard, lrf, lidars=(lidar,), depth_cameras=(camera,), radius=0.2,
                     obstacles=(moving,) * crowded)  # fmt: skip
    envs = DriveVectorEnv(40, world, sigma=0.0)
    seen, _ = envs.reset(seed=1)
    assert envs.observation_space.contains(seen)
    caster = lrf3d.PlanarCaster(yard)
    now = Conditions(0.0, None, Crowd(world.obstacles))
    for robot, pose in enumerate(envs.poses):
        scan = caster.cast_lidar(lidar, compose(pose, np.array([0.1, 0, 0])), now)
        assert np.array_equal(seen["lidar"][robot], scan.ranges.clip(0, 100).astype(np.float32))
        image = caster.cast_depth(camera, pose, now)
        assert np.array_equal(seen["depth"][robot], image.depth.clip(0, 20).astype(np.float32))


def test_the_noise_of_lidars_is_normal_and_leaves_range_finders_alone():
    walls = lrf3d.World([[-9, -9, 9, -9], [9, -9, 9, 9], [9, 9, -9, 9], [-9, 9, -9, -9]])
    plain = Scenario(walls, lrf3d.LaserRangeFinder(beams=5), radius=0.2)
    lidar = lrf3d.Lidar(np.linspace(-0.06, 0.06, 6), columns=90, range_max=50.0)
    envs = DriveVectorEnv(60, replace(plain, lidars=(lidar,)), sigma=0.5)
    seen, _ = envs.reset(seed=3)
    assert np.array_equal(DriveVectorEnv(60, plain, sigma=0.5).reset(seed=3)[0]["ranges"],
                          seen["ranges"])  # fmt: skip
    true = np.array([lrf3d.PlanarCaster(walls).cast_lidar(lidar, p).ranges for p in envs.poses])
    # Every beam meets a wall or the floor.
    drawn = (seen["lidar"] - true) / (0.01 * true)
    moments = [np.mean(drawn**k) for k in (1, 2, 4)]
    assert moments == pytest.approx([0.0, 1.0, 3.0], abs=0.1)
    neighbours = drawn[:, 1:] * drawn[:, :-1], drawn[..., 1:] * drawn[..., :-1]
    assert [each.mean() for each in neighbours] == pytest.approx([0.0, 0.0], abs=0.03)
    assert not np.array_equal(envs.step(np.zeros((60, 2)))[0]["lidar"], seen["lidar"])
