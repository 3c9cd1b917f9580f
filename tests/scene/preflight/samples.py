"""Objects and missions for the two rooms of :mod:`tests.languages.plans`, and the findings."""

import functools

from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot_files import load_robot
from grammars.preflight import check_run
from grammars.text.diagnostics import Where
from tests.languages import plans
from tests.parts import ROOT

ROBILE = load_robot(ROOT / "campaigns" / "robots" / "robile.yaml")
"""A robot of 0.699 m x 0.466 m, 0.289 m high."""

DOOR = "d is a hinged_door in kitchen_doorway, hinge left, opening into kitchen\n"
OTHER = "e is a hinged_door in way_out, hinge left, opening inwards\n"


scene_with = functools.cache(plans.scene_with)
"""The two rooms with objects, compiled once for all tests that ask for the same ones."""


def mission(*points, start=None):
    waypoints = tuple(Waypoint(f"w{i}", x, y) for i, (x, y) in enumerate(points))
    return Mission("m", start or Pose2(), waypoints)


def shown(findings):
    """Return findings as texts: message and hint, with a ``?`` in front of warnings."""
    return [
        "? " * (d.severity == "warning") + d.message + (f" ({d.hint})" if d.hint else "")
        for d in findings
    ]


def messages(scene, task, *behaviours, robot=ROBILE):
    """Return every finding about a run, as a text."""
    if isinstance(scene, str):
        scene = scene_with(scene)
    return shown(check_run(scene, robot, task, behaviours, where=Where("task.yaml")))
