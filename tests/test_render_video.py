"""Films: number, size and kind of the frames, and what is left when drawing fails."""

import os
import signal
import subprocess
import sys
import time

import av
import numpy as np
import pytest
from test_render import city_run, needs_gl, room_run

from lrf3d.errors import InputError, MissingLibraryError, OutputError
from lrf3d.render import video


def read(path):
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
        return stream.codec_context.name, float(stream.average_rate), frames


@needs_gl
def test_a_film_has_its_frames_in_order_from_all_workers(tmp_path):
    run = city_run(seconds=2.0)
    seen = []
    path = tmp_path / "run.mp4"
    size = (320, 180)
    video.render_video(
        run, path, size=size, fps=10, samples=0, workers=2, progress=lambda *done: seen.append(done)
    )
    codec, rate, frames = read(path)
    assert (codec, rate) == ("h264", 10.0)
    assert len(frames) == 21 and {frame.shape for frame in frames} == {(180, 320, 3)}
    assert seen[-1] == (21, 21) and [done for done, _ in seen] == sorted(done for done, _ in seen)
    for index in (0, 9, 10, 11, 20):
        alone = video.frame(run, index / 10, size=size, samples=0).astype(int)
        others = [np.abs(frame.astype(int) - alone).mean() for frame in frames]
        assert int(np.argmin(others)) == index
        assert others[index] < 6.0
    assert os.listdir(tmp_path) == ["run.mp4"]


@needs_gl
def test_a_failing_worker_leaves_no_file(tmp_path, monkeypatch):
    path = tmp_path / "run.mp4"
    path.write_bytes(b"before")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "nonsense")
    with pytest.raises((RuntimeError, MissingLibraryError), match="nonsense"):
        video.render_video(room_run(), path, size=(64, 36), fps=4, samples=0, workers=1)
    assert path.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["run.mp4"]


@needs_gl
def test_an_error_in_progress_ends_all_and_leaves_no_file(tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        video.render_video(
            city_run(), tmp_path / "a.mp4", size=(64, 36), fps=4, workers=1, progress=stop
        )
    assert os.listdir(tmp_path) == []


@needs_gl
def test_workers_end_when_their_caller_is_killed(tmp_path):
    script = (
        "import sys; sys.path[:0] = sys.argv[1:3]\n"
        "from test_render import city_run\n"
        "from lrf3d.render.video import render_video\n"
        "render_video(city_run(), sys.argv[3], size=(64, 36), fps=2000, workers=1,\n"
        "             progress=lambda *done: print('drawing', flush=True))\n"
    )
    here = os.path.dirname(__file__)
    command = [sys.executable, "-c", script, here, os.path.dirname(here), str(tmp_path / "a.mp4")]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as caller:
        caller.stdout.readline()
        caller.send_signal(signal.SIGKILL)
    limit = time.monotonic() + 10.0
    while os.listdir(tmp_path) and time.monotonic() < limit:
        time.sleep(0.02)
    assert os.listdir(tmp_path) == []


@needs_gl
def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(OutputError, match="nowhere"):
        video.render_video(room_run(), tmp_path / "nowhere" / "a.mp4", size=(64, 36))


@pytest.mark.parametrize("wrong", [{"size": (65, 36)}, {"fps": 0.0}, {"workers": 0}])
def test_a_film_that_cannot_be_drawn_is_refused(tmp_path, wrong):
    with pytest.raises(InputError):
        video.render_video(room_run(), tmp_path / "a.mp4", **{"size": (64, 36), **wrong})
    assert os.listdir(tmp_path) == []
