"""Stopping: a signal is only noted, loops end where they check it, and handlers come back."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures.process import BrokenProcessPool

import pytest
from program import lrf3d as program

import lrf3d
from lrf3d.base.cores import process_pool
from lrf3d.base.interrupts import check, stoppable

POSES = [(1 + 0.01 * k, 1, 0) for k in range(20)]


def stopping_after(scans):
    """Progress that presses Ctrl-C after a number of scans, and counts those that follow."""
    seen = []

    def report(done, total):
        seen.append(done)
        if done == scans:
            signal.raise_signal(signal.SIGINT)

    return seen, report


@pytest.fixture
def room():
    return lrf3d.load_world("paper_room")


def test_ctrl_c_ends_a_simulation_after_the_scan_at_hand_and_the_handler_comes_back(room):
    seen, report = stopping_after(3)
    with pytest.raises(KeyboardInterrupt):
        lrf3d.simulate(room, POSES, rng=0, progress=report)
    assert seen == [1, 2, 3]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    # The request to stop was for that simulation.
    assert len(lrf3d.simulate(room, POSES, rng=0)) == len(POSES)


def test_an_interrupt_is_not_raised_within_a_step():
    """A mapper in which the signal arrives finishes its scan; raising there could crash it."""
    done = []

    class Mapper:
        def update(self, scan):
            signal.raise_signal(signal.SIGINT)
            done.append(scan)

    with pytest.raises(KeyboardInterrupt):
        lrf3d.simulate(lrf3d.load_world("paper_room"), POSES, mapper=Mapper(), rng=0)
    assert len(done) == 1


def test_a_second_ctrl_c_ends_a_step_that_hangs():
    with pytest.raises(KeyboardInterrupt), stoppable():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        pytest.fail("the second one was not raised")


def test_an_interrupt_that_comes_after_the_last_step_is_not_lost():
    with pytest.raises(KeyboardInterrupt), stoppable():
        signal.raise_signal(signal.SIGINT)
    check()


def test_a_handler_of_the_user_and_other_threads_are_left_alone(room):
    heard = []
    signal.signal(signal.SIGINT, lambda number, where: heard.append(number))
    seen, report = stopping_after(3)
    assert len(lrf3d.simulate(room, POSES, rng=0, progress=report)) == len(POSES) == len(seen)
    assert heard == [signal.SIGINT]
    signal.signal(signal.SIGINT, signal.default_int_handler)
    runs = []
    thread = threading.Thread(target=lambda: runs.append(lrf3d.simulate(room, POSES, rng=0)))
    thread.start()
    thread.join()
    assert len(runs[0]) == len(POSES)


HANGING = """
import sys, time
class Mapper:
    def update(self, scan):
        print("begun", file=sys.stderr, flush=True)
        while True:
            time.sleep(0.01)
"""


@pytest.mark.parametrize("again", [True, False])
@pytest.mark.parametrize(
    "number", ["SIGINT", *(pytest.param(n, marks=pytest.mark.slow) for n in ("SIGTERM", "SIGHUP"))]
)
def test_what_hears_no_signal_is_ended_by_a_second_one_or_after_a_while(number, again, tmp_path):
    number = getattr(signal, number, None)
    if number is None or os.name != "posix":
        pytest.skip("no such signal here")
    (tmp_path / "hanging.py").write_text(HANGING)
    process = subprocess.Popen(
        [sys.executable, "-m", "lrf3d", "run", "paper_room", "--mapper", "hanging.py:Mapper"],
        cwd=tmp_path, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr.readline() == "begun\n"
    sent = time.monotonic()
    process.send_signal(number)
    if again:
        # Two at the same time count as one: that is how programs between the terminal and this one
        # forward a Ctrl-C.
        time.sleep(0.3)
        # A machine that slept longer has used up the while.
        assert process.poll() is None or time.monotonic() > sent + 1.0
        process.send_signal(number)
    _, err = process.communicate(timeout=300)
    kept = "0 of 3 scans kept; go on with --resume"
    assert (process.returncode, err) == (128 + number, f"lrf3d: stopped; {kept}\n")
    assert not [*tmp_path.rglob("*unfinished*"), *tmp_path.rglob("*.lock")]


def test_an_interrupt_before_anything_is_loaded_is_one_line():
    code = """
import signal, sys
class Interrupting:
    def find_spec(name, *_):
        if name == "lrf3d.apps.cli":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Interrupting)
from lrf3d.__main__ import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "lrf3d: stopped\n")


def test_a_signal_that_comes_twice_at_once_counts_once(tmp_path):
    (tmp_path / "twice.py").write_text(
        "import signal\n"
        "class Mapper:\n"
        "    def update(self, scan):\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "        signal.raise_signal(signal.SIGINT)\n"
    )
    arguments = ("run", "paper_room", "--no-video", "--mapper", "twice.py:Mapper")
    done = program(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (
        130,
        "lrf3d: stopped; 1 of 3 scans kept; go on with --resume\n",
    )


DELETING = """
import shutil
class Mapper:
    def update(self, scan):
        shutil.rmtree("out", ignore_errors=True)
"""


def test_a_folder_that_is_deleted_meanwhile_keeps_no_scans(tmp_path):
    (tmp_path / "deletes.py").write_text(DELETING)
    arguments = ("run", "paper_room", "--no-video", "--mapper", "deletes.py:Mapper", "--out", "out")
    done = program(*arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert "out: No such file" in done.stderr
    assert "kept" not in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.skipif(sys.platform != "linux", reason="limits of the address space")
def test_too_little_memory_for_compiled_code_is_one_line(tmp_path):
    command = f"ulimit -v 600000; exec {sys.executable} -m lrf3d run paper_room"
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (
        1,
        "lrf3d: the limit of memory is 614.4 MB, and compiled code needs 1.2 GB; raise it:"
        " ulimit -v unlimited\n",
    )


def test_a_pool_that_is_left_early_ends_without_a_word(monkeypatch):
    raised = []
    monkeypatch.setattr(threading, "excepthook", raised.append)
    with pytest.raises(KeyboardInterrupt), process_pool(2) as pool:
        futures = [pool.submit(time.sleep, 60.0) for _ in range(20)]
        raise KeyboardInterrupt
    assert all(isinstance(each.exception(0.0), BrokenProcessPool) for each in futures)
    assert raised == []


LEAVING = """
import os
from lrf3d.base.cores import process_pool
if __name__ == "__main__":
    with process_pool(1):
        os._exit(3)
"""


def test_a_program_that_is_ended_at_once_says_nothing_of_its_locks(tmp_path):
    (tmp_path / "leaving.py").write_text(LEAVING)
    command = [sys.executable, tmp_path / "leaving.py"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (3, "")


def test_a_signal_stops_what_reads_a_file_at_once():
    """Parsers check for no signal, and may make something else of what it raises."""
    code = """
import os, signal
from lrf3d.base.interrupts import handle_signals, ignore_signals, reading
for wrong in (False, True):
    handle_signals("test")
    try:
        with reading():
            try:
                os.kill(os.getpid(), signal.SIGINT)
                while True:
                    pass
            except KeyboardInterrupt:
                if wrong:
                    raise ValueError("damaged") from None
                raise
    except KeyboardInterrupt:
        print("stopped", flush=True)
    ignore_signals()
"""
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (made.stdout, made.stderr) == ("stopped\n" * 2, "")
