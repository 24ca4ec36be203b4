"""What a simulation asks a mapper for."""

from typing import get_type_hints

import lrf3d
from lrf3d.simulation.mappers import FullMapper, OptionalParts

ROOM = lrf3d.load_world("paper_room")
DRIVE = [(1, 1, 0), (1.2, 1, 0)]
LASERS = [lrf3d.LaserRangeFinder(beams=9, name=name) for name in ("front", "rear")]


class Counting:
    """A mapper with `update` alone, which returns the map."""

    def __init__(self):
        self.scans = 0

    def update(self, scan):
        self.scans += 1
        return [scan.laser, self.scans]


class Asked:
    """A mapper that remembers which of its attributes were looked up."""

    def __init__(self):
        self.names = set()

    def __getattribute__(self, name):
        if not name.startswith("__") and name != "names":
            self.names.add(name)
        return object.__getattribute__(self, name)

    def update(self, scan):
        return None


def test_a_mapper_with_update_alone_gets_each_scan_and_returns_its_map():
    simulation = lrf3d.Simulation(
        ROOM, DRIVE, LASERS, mapper=Counting(), odometry=lrf3d.WheelOdometry()
    )
    assert [step.map for step in simulation] == [["rear", 2], ["rear", 4]]
    assert simulation.estimate is None
    parts = OptionalParts(simulation.mapper)
    assert (parts.mode, parts.drive, parts.report) == (None, None, None)


def test_all_that_a_mapper_is_asked_for_is_declared():
    mapper = Asked()
    simulation = lrf3d.Simulation(
        ROOM, DRIVE, LASERS, mapper=mapper, odometry=lrf3d.WheelOdometry()
    )
    list(simulation)
    assert (simulation.map, simulation.estimate) == (None, None)
    declared = {name for name in dir(FullMapper) if not name.startswith("_")}
    assert mapper.names <= declared
    assert declared == {"update", "map", "estimate", "several", "mode", "drive", "report"}


def test_several_lasers_are_typed_as_they_are_taken():
    laser = get_type_hints(lrf3d.Simulation.__init__)["lrf"]
    assert get_type_hints(lrf3d.simulate)["lrf"] == laser
    assert len(lrf3d.simulate(ROOM, DRIVE, LASERS, rng=0).lasers) == 2
