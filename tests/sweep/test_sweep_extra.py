"""Sweeps without Dask, and what its clusters leave behind."""

import gc
import subprocess
import sys

from distributed import Scheduler

from lrf3d.errors import install_command
from lrf3d.sweep.cluster import connected


def test_without_the_extra_one_line_says_what_to_install_and_the_paper_needs_none():
    code = (
        "import sys\n"
        "for name in ('dask', 'distributed', 'pyarrow'): sys.modules[name] = None\n"
        "import benchmarks.paper.report\n"
        "sys.argv = ['lrf3d', 'sweep', 'paper_room']\n"
        "from lrf3d.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and done.stdout == ""
    what = f"sweeps need Dask and Parquet; install it: {install_command('sweep')}"
    assert done.stderr == f"lrf3d: {what}\n"


def test_a_cluster_that_has_ended_keeps_no_memory():
    for _ in range(2):
        with connected(None, workers=1):
            pass
    gc.collect()
    assert not any(isinstance(each, Scheduler) for each in gc.get_objects())
