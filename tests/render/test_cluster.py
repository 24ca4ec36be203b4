"""Films from a cluster: the same bytes as from this machine, whatever dies meanwhile."""

import os
import pickle
import signal
import subprocess
from pathlib import Path

import pytest
from test_render import needs_gl, room_run
from typer.testing import CliRunner

from lrf3d.cli.app import app
from lrf3d.cluster.connection import connected
from lrf3d.errors import InputError
from lrf3d.logs import save_run
from lrf3d.render import video
from lrf3d.render.cluster_parts import draw_there
from lrf3d.render.film_parts import split_frames
from lrf3d.render.worker import Job

SMALL = {"size": (64, 36), "fps": 20, "samples": 0, "renderer": "embree"}


@pytest.fixture(scope="module")
def client():
    """A client of two workers with one thread each, on this machine."""
    with connected(None, 2) as client:
        yield client


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """A film of two parts, drawn without a cluster."""
    path = tmp_path_factory.mktemp("here") / "run.mp4"
    video.render_video(room_run(), path, workers=2, **SMALL)
    return path.read_bytes()


def address(client):
    return client.scheduler.address


def test_a_cluster_draws_the_file_that_this_machine_draws_bit_for_bit(client, here, tmp_path):
    heard = []
    path = tmp_path / "run.mp4"
    video.render_video(
        room_run(), path, scheduler=address(client), progress=lambda *step: heard.append(step),
        **SMALL,
    )  # fmt: skip
    assert path.read_bytes() == here
    total = heard[0][1]
    assert heard[-1] == (total, total) and len(split_frames(total, None, at_once=2)) == 2
    assert os.listdir(tmp_path) == ["run.mp4"]


def test_a_worker_that_is_killed_leaves_its_part_to_another(client, here, tmp_path):
    killed = []

    def kill(done, total):
        if not killed:
            killed.append(min(client.run(os.getpid).values()))
            os.kill(killed[0], signal.SIGKILL)

    path = tmp_path / "run.mp4"
    video.render_video(
        room_run(), path, scheduler=address(client), workers=2, progress=kill, **SMALL
    )
    assert killed and path.read_bytes() == here
    client.wait_for_workers(2, timeout=60)


def test_frames_come_whole_and_in_order_from_a_cluster(client, tmp_path):
    asked = {**SMALL, "fps": 2}
    count = video.render_frames(room_run(), tmp_path / "here", workers=1, **asked)
    scheduler = address(client)
    assert count == video.render_frames(
        room_run(), tmp_path / "there", workers=3, scheduler=scheduler, **asked
    )
    names = sorted(os.listdir(tmp_path / "here"))
    assert sorted(os.listdir(tmp_path / "there")) == names and len(names) == count
    for name in names:
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()


def drawers(folder: Path) -> int:
    """How many processes draw parts that lie in a folder."""
    listed = subprocess.run(["ps", "-eww", "-o", "args"], capture_output=True, text=True).stdout
    return sum("lrf3d.render.worker" in line and str(folder) in line for line in listed.split("\n"))


def test_who_stops_a_film_leaves_no_file_and_no_process(client, tmp_path):
    client.run(_put_temporary_files, str(tmp_path))
    try:
        began = []

        def stop(done, total):
            began.append(drawers(tmp_path))
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            video.render_video(
                room_run(), tmp_path / "run.mp4", workers=1, progress=stop,
                scheduler=address(client), **{**SMALL, "fps": 1000},
            )  # fmt: skip
        assert began == [1] and not (tmp_path / "run.mp4").exists()
        # The next task comes when the worker's only thread is free again.
        workers = list(client.scheduler_info()["workers"])
        ends = [client.submit(os.getpid, workers=[name], pure=False) for name in workers]
        client.gather(ends)
        assert drawers(tmp_path) == 0 and os.listdir(tmp_path) == []
    finally:
        client.run(_put_temporary_files, None)


def _put_temporary_files(folder):
    import tempfile

    tempfile.tempdir = folder


def _set(name, value):
    if value is None:
        del os.environ[name]
    else:
        os.environ[name] = value


def test_a_known_error_on_a_worker_is_raised_here(client):
    run = room_run()
    times = video.Timeline(run, playback=1.0).frame_times(1.0)
    job = Job(run, times, (64, 36), 1.0, 1.0, "no such view", 0, "embree", ".mp4")
    packed = pickle.dumps(job)
    found = client.submit(draw_there, packed, 0, (0, 1), "test").result(timeout=60)
    assert isinstance(found, InputError)


@needs_gl
def test_a_worker_without_opengl_says_so_and_embree_can_draw_instead(client, tmp_path):
    client.run(_set, "PYOPENGL_PLATFORM", "nonsense")
    try:
        run = tmp_path / "run.npz"
        save_run(room_run(), run)
        command = ["render", str(run), "--scheduler", address(client), "--size", "64x64"]
        result = CliRunner().invoke(app, [*command, "--fps", "1"], catch_exceptions=False)
        assert "by Embree" in result.stdout and (tmp_path / "run.mp4").exists()
    finally:
        client.run(_set, "PYOPENGL_PLATFORM", None)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--scheduler", "localhost"], "expected an address such as tcp://"),
        (["--scheduler", "tcp://127.0.0.1:1", "--at", "1"], "one picture is drawn here"),
    ],
)
def test_a_scheduler_that_is_none_or_of_no_use_is_refused(tmp_path, flags, words):

    save_run(room_run(), tmp_path / "run.npz")
    with pytest.raises(InputError, match=words):
        CliRunner().invoke(
            app, ["render", str(tmp_path / "run.npz"), *flags], catch_exceptions=False
        )
    assert os.listdir(tmp_path) == ["run.npz"]
