"""Repairs of recordings: one list for maps, SLAM and localisation, which leave out any of it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from drives import FLAT, drive, flat_drive, recorded

import lrf3d
from lrf3d.apps.cli.commands import COMMANDS
from lrf3d.apps.cli.inputs import read_log
from lrf3d.apps.cli.parser import parse
from lrf3d.base.errors import InputError, Lrf3dWarning
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.body import BODY
from lrf3d.recordings.repair.repairs import (
    LOCALISING,
    MAPPING,
    REPAIRS,
    SOLVING,
    figures_of,
    repair,
)


@pytest.fixture(scope="module")
def mirrored():
    """The log of a laser that turns clockwise, which it does not say, and the true poses."""
    scans, wheels, true = flat_drive(100)
    turned = [replace(scan, ranges=scan.ranges[::-1]) for scan in scans]
    return recorded(turned, wheels, "mirrored"), true


def test_each_repair_has_a_name_of_its_own_and_figures_of_its_own():
    names = [each.name for each in REPAIRS]
    assert len(set(names)) == len(names)
    figures = [set(each.figures(None)) for each in REPAIRS]
    assert sum(map(len, figures)) == len(set().union(*figures))
    assert {*MAPPING.left_out, *SOLVING.left_out, *LOCALISING.left_out} <= set(names)


@pytest.mark.parametrize("command", ["map", "slam", "localise"])
def test_the_help_lists_all_repairs(command):
    line = re.search(r"--without-repair REPAIR,…: [^:]*: ([^.]*)\.", COMMANDS[command])
    assert line is not None
    assert line[1].replace("\n", "").split(", ") == [each.name for each in REPAIRS]


@pytest.mark.parametrize("purpose", [MAPPING, SOLVING, LOCALISING])
def test_a_repair_is_found_and_can_be_left_out(purpose, mirrored):
    log, _ = mirrored
    [recording] = repair(log, purpose)
    assert figures_of(recording)["mirrored"]
    [as_it_is] = repair(log, purpose, ["mirror"])
    assert "mirror" not in as_it_is.found and not figures_of(as_it_is)["mirrored"]
    for kept, read in zip(as_it_is.scans, log.scans, strict=True):
        assert np.array_equal(kept.ranges, read.ranges)


def test_a_repair_that_does_not_exist_is_an_error_that_names_the_nearest_one(mirrored):
    for call in (lrf3d.map_log, lrf3d.slam_log):
        with pytest.raises(InputError, match="no 'mirrors'; did you mean 'mirror'"):
            call(mirrored[0], without_repairs=["mirrors"])


def test_a_map_is_made_without_a_repair(mirrored):
    log, _ = mirrored
    with pytest.warns(Lrf3dWarning, match="contradict the laser's mount: .* mirrored"):
        run = lrf3d.map_log(log, without_repairs=["mirror"])
    assert np.array_equal(run.scan(0).ranges, log.scans[0].ranges)


@pytest.mark.slow
def test_a_robot_whose_laser_is_mirrored_is_localised(mirrored):
    log, true = mirrored
    found = lrf3d.localise_log(FLAT, log)
    assert any("clockwise" in note for note in found.log.notes)
    off = (found.poses - true)[found.known]
    assert len(off) > 50 and np.hypot(off[:, 0], off[:, 1]).max() < 0.2


def test_a_repair_that_makes_the_whole_worse_is_taken_back(mirrored):
    def spread(factor):
        def apply(recording, _):
            wider = [replace(scan, angles=factor * scan.angles) for scan in recording.scans]
            return replace(recording, scans=wider)

        return Repair(f"spread by {factor}", lambda _: True, apply)

    [recording] = repair(mirrored[0], SOLVING)
    assert recording.repaired(spread(1.3)) is recording
    wide = spread(1.3).apply(recording, None)
    assert wide.repaired(spread(1 / 1.3)).found.keys() - wide.found.keys()


def with_posts(scan):
    """A scan of a robot whose posts stand 0.3 m from its laser at three bearings."""
    ranges = scan.ranges.copy()
    for beam in (20, 90, 150):
        ranges[beam : beam + 5] = 0.3 + 0.002 * np.sin(np.arange(5) + scan.ranges[:5])
    return replace(scan, ranges=ranges)


def test_what_stays_with_the_robot_is_itself_and_left_out(mirrored):
    log, _ = mirrored
    log = replace(log, scans=list(map(with_posts, log.scans)))
    seen = replace(log, scans=log.scans[:60])
    repaired = repair(seen, MAPPING)[0].log
    assert not any((scan.ranges[scan.hits] < 0.4).any() for scan in repaired.scans)
    assert sum("the robot itself" in note for note in repaired.notes) == 1
    far = [
        (new.ranges == old.ranges).mean()
        for new, old in zip(repaired.scans, seen.scans, strict=True)
    ]
    assert min(far) > 1 - 30 / 181
    standing = replace(log, scans=log.scans[:1] * 60)
    assert BODY.find(standing) is None and BODY.find(mirrored[0]) is None


def test_walls_along_a_straight_drive_do_not_stay_with_the_robot():
    hall = lrf3d.World([[0, 0, 60, 0], [0, 1.6, 60, 1.6], [0, 0, 0, 1.6], [60, 0, 60, 1.6]])
    lrf = lrf3d.LaserRangeFinder(beams=181, range_max=30.0)
    scans, wheels, _ = drive(hall, [(2, 0.8), (50, 0.8)], lrf=lrf)
    assert BODY.find(recorded(scans, wheels)) is None


@pytest.mark.parametrize("options", ["--smallest-range 0.5", "--mask=-91:-80,80:91"])
def test_what_the_user_masks_is_left_out_and_counted(options, mirrored, tmp_path):
    scans = [replace(scan, ranges=scan.ranges.clip(0.2)) for scan in mirrored[0].scans]
    save = lrf3d.map_log(replace(mirrored[0], scans=scans))
    lrf3d.export_run(save, "carmen", tmp_path / "drive.log")
    args = parse(["map", str(tmp_path / "drive.log"), *options.split()])
    log = read_log(args)
    assert any("left out, near the laser or masked" in note for note in log.notes)
    hits = np.array([scan.hits for scan in log.scans])
    near = any((scan.ranges[scan.hits] <= 0.5).any() for scan in log.scans)
    assert not near if "range" in options else not hits[:, :10].any() and hits[:, 30].any()
