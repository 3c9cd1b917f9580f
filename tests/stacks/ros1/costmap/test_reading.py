"""Files of people, with and without ``plugins``: the layers move_base would make of them.

``reading.txt`` holds costmaps as they are written, and below each what is read and said, with the
values that differ from the defaults. A new one needs its YAML only, ``pytest --update`` adds the
rest. In brackets stand what is written above it, the frames of amcl, the maps that are published,
the topics of lasers, and whether it is the costmap that stops the robot.
"""

from pathlib import Path

import yaml

from daemon.stacks.findings import FindingCollector
from daemon.stacks.ros1.costmap.reading import CostmapContext, CostmapReader
from tests.stacks.cases import cases, written
from tests.stacks.ros1.sections import said, shown

READING = Path(__file__).with_name("reading.txt")
PLACE = ("costmap",)


def read(given):
    """Return a costmap, and what was said of it."""
    report, heard = FindingCollector(), given.pop("(heard)", None)
    context = CostmapContext(
        above=given.pop("(above)", {}),
        frames=given.pop("(frames)", {"map": "map", "odom": "odom"}),
        resolve=lambda name: f"/{name.lstrip('/')}",
        maps=tuple(given.pop("(maps)", ["/map"])),
        may_carry_scan=lambda topic: heard is None or topic in heard,
        stops_robot=given.pop("(stops robot)", False),
    )
    return CostmapReader(given, PLACE, report, context).read(), report


def test_costmaps_are_read_as_they_are_written(golden):
    told = []
    for name, lines in cases(READING):
        costmap, report = read(yaml.safe_load("\n".join(lines)) or {})
        results = [] if report.fatal else shown(costmap)
        told += written((name, lines), results + said(report.fatal, report))
    golden(READING.name, "\n".join(told) + "\n")
