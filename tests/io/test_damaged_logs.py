"""Logs cut short and with bytes changed: a log or one clear line, never anything else."""

import numpy as np
import pytest
from synthetic_run import around, box, make_run, make_world

from lrf3d.errors import InputError
from lrf3d.exporting import export_run
from lrf3d.io import LaserLog, load_log, save_run
from lrf3d.laser import LaserRangeFinder

KINDS = ["run.log", "run.log.gz", "run.mcap", "run.db3", "run_bag", "db3_bag", "run.npz"]
SEEDS = range(10)
SHORTEST = {"run.log": 700}
"""Bytes of a log in lines that hold no whole scan; what is left of it after that is one."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A log of each kind, and the file within it that is to be damaged."""
    folder = tmp_path_factory.mktemp("whole")
    world = make_world(box(0, 0, 10, 8), box(4.5, 3.5, 1, 1))
    lrf = LaserRangeFinder(-1.5, 1.5, 31, range_max=40.0)
    run = make_run(world, around(5, 4, 2.5, 24, heading=np.pi / 2), lrf, sigma=0.02)
    export_run(run, "carmen", folder / "run.log")
    export_run(run, "carmen", folder / "run.log.gz")
    export_run(run, "mcap", folder / "run.mcap")
    export_run(run, "rosbag2", folder / "run_bag")
    save_run(run, folder / "run.npz")
    as_sqlite(folder / "run_bag", folder / "db3_bag")
    (folder / "run.db3").write_bytes((folder / "db3_bag" / "db3_bag.db3").read_bytes())
    return {
        kind: {
            file.relative_to(folder): file.read_bytes()
            for file in ([folder / kind] if "." in kind else sorted((folder / kind).iterdir()))
        }
        for kind in KINDS
    }


def as_sqlite(bag, path):
    """Write the messages of a bag as older releases of ROS 2 kept them."""
    from rosbags.rosbag2 import Reader, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with (
        Reader(bag) as reader,
        Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer,
    ):
        topics = {
            c.topic: writer.add_connection(c.topic, c.msgtype, typestore=store)
            for c in reader.connections
        }
        for connection, stamp, data in reader.messages():
            writer.write(topics[connection.topic], stamp, data)


def put(files, folder):
    for name, data in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)


def loaded(path):
    """The log, or the one line that says why there is none."""
    try:
        return load_log(path)
    except InputError as error:
        assert "\n" not in str(error) and path.name in str(error) and len(str(error)) < 400
        return str(error)


def test_what_is_no_log_is_refused_with_the_reason(tmp_path):
    (tmp_path / "junk.log").write_bytes(bytes(range(256)) * 10)
    (tmp_path / "world.toml").write_text("")
    reasons = {"no.log": "no such file", "junk.log": "no laser scan", "world.toml": ".log.gz"}
    for name, reason in reasons.items():
        assert reason in loaded(tmp_path / name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_log_cut_short_is_refused_or_says_what_is_missing(whole, kind, seed, tmp_path):
    rng = np.random.default_rng(seed)
    files = dict(whole[kind])
    cut = sorted(files)[seed % len(files)]
    length = int(rng.integers(0, len(files[cut]) - 1))
    files[cut] = files[cut][:length]
    put(files, tmp_path)
    result = loaded(tmp_path / kind)
    if kind.startswith("run.log"):
        # Lines before the cut are as good as ever.
        assert isinstance(result, str) or 0 < len(result) < 24 or result.bad_count <= 1
    elif cut.suffix in (".mcap", ".npz"):
        assert isinstance(result, str)
    else:
        assert isinstance(result, LaserLog | str)
