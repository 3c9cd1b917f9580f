"""Short scenes for the whole stack: a room of walls, a doorway, a door, and one run in them."""

import copy
import math
from pathlib import Path

import yaml

from daemon.model.spec import MapSettings, OracleText, RunSpec, SutReference
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Joint, Link, Scene, SceneObject, Solid

ROBOT = Robot(
    "planar-move",
    ((-0.35, -0.233), (0.35, -0.233), (0.35, 0.233), (-0.35, 0.233)),
    0.29,
    150.0,
    Drive(
        "omnidirectional", *(math.inf,) * 8, 0.0,
        law="imposed", friction_loss=0.0098, turning_loss=0.047,
    ),
    Laser(
        Mount(0.3), 0.3, -1.57, 1.57, 150, 0.05, 5.6, 10.0, 0.01, 0.0, too_near="clamped"
    ),
    OdometryNoise(1.0 / 0.051, 0.0, 0.0, 0.0, period=0.051, twist="mean", origin="map"),
)  # fmt: skip

DIFFERENTIAL = yaml.safe_load(Path(__file__).with_name("differential.yaml").read_text("utf-8"))


def configured(**changes):
    """Return the configuration with values changed, ``move_base__planner_patience=1.0``."""
    tree = copy.deepcopy(DIFFERENTIAL)
    for name, value in changes.items():
        *path, last = name.split("__")
        node = tree
        for part in path:
            node = node.setdefault(part, {})
        node[last] = value
    return tree


def box(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def room(*boxes, door=False, size=(6.0, 4.0)):
    """Walls 0.2 m thick around ``size``, ``boxes`` inside, and a door hinged at (3, 1.55)."""
    width, depth = size
    outside = (
        box(-0.2, -0.2, width + 0.2, 0.0),
        box(-0.2, depth, width + 0.2, depth + 0.2),
        box(-0.2, 0.0, 0.0, depth),
        box(width, 0.0, width + 0.2, depth),
    )
    solids = tuple(
        Solid(f"wall-{k}", "wall", ring, 0.0, 2.5) for k, ring in enumerate((*outside, *boxes))
    )
    objects = ()
    if door:
        leaf = Link("leaf", (box(-0.025, 0.0, 0.025, 0.9),), 15.0, 0.0, 2.0)
        hinge = Joint(
            "hinge", "revolute", "world", "leaf", (0.0, 0.0), (0.0, 0.0), -1.6, 1.6, 0.5, 1.0, 8.0
        )  # fmt: skip
        objects = (SceneObject("door", "door", Pose2(3.0, 1.55), (leaf,), (hinge,), (-1.57,)),)
    return Scene("room", (), (), solids, objects)


DOORWAY = (box(2.9, 0.0, 3.1, 1.5), box(2.9, 2.5, 3.1, 4.0))
"""A wall across the room with a gap of one metre."""


def run(
    folder,
    scene,
    waypoints,
    parameters=DIFFERENTIAL,
    *,
    start=Pose2(1.0, 2.0, 0.0),  # noqa: B008
    behaviours=(),
    limit=60.0,
    seed=1,
    oracle="reached(mission, 0.35 m)",
    robot=ROBOT,
):
    """Run the stack in ``scene`` from ``start`` and return what came of it."""
    spec = RunSpec(
        "test", "short", SutReference("ros", "ros", dict(parameters)), 0, scene.digest, robot,
        Mission("short", start, waypoints), behaviours, (OracleText("reached", oracle),),
        MapSettings(), seed, limit,
    )  # fmt: skip
    path = folder / "run.mcap"
    result = execute(spec, scene, trace_path=path)
    return result, read_trace(path)


def said(trace, words):
    """Return when the stack said something with ``words`` in it."""
    return [event.time for event in trace.events if event.source == "sut" and words in event.text]
