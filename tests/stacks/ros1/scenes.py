"""Short scenes for the whole stack: a room of walls, a doorway, a door, and one run in them."""

import copy
import math

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

_SCAN = {"data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True}
_COSTMAP = {
    "footprint": [[0.35, 0.233], [0.35, -0.233], [-0.35, -0.233], [-0.35, 0.233]],
    "obstacle_range": 3.0,
    "raytrace_range": 3.5,
    "observation_sources": "scan",
    "scan": _SCAN,
}
DIFFERENTIAL = {
    "amcl": {
        "min_particles": 500,
        "max_particles": 1000,
        "odom_model_type": "diff-corrected",
        "laser_model_type": "likelihood_field",
        "update_min_d": 0.1,
        "update_min_a": 0.25,
        "transform_tolerance": 0.5,
        "initial_cov_xx": 0.01,
        "initial_cov_yy": 0.01,
        "initial_cov_aa": 0.01,
    },
    "move_base": {
        "base_local_planner": "dwa_local_planner/DWAPlannerROS",
        "controller_frequency": 10.0,
        "planner_frequency": 5.0,
        "oscillation_timeout": 10.0,
        "oscillation_distance": 0.2,
        "global_costmap": {
            **_COSTMAP, "global_frame": "map", "static_map": True, "update_frequency": 10.0,
            "inflation_radius": 0.5, "cost_scaling_factor": 3.0,
        },
        "local_costmap": {
            **_COSTMAP, "global_frame": "odom", "rolling_window": True, "update_frequency": 5.0,
            "width": 3.0, "height": 3.0, "inflation_radius": 0.55, "cost_scaling_factor": 5.0,
        },
        "DWAPlannerROS": {
            "max_vel_x": 0.4, "min_vel_x": -0.22, "max_vel_y": 0.0, "min_vel_y": 0.0,
            "max_vel_trans": 0.4, "min_vel_trans": 0.11, "max_vel_theta": 2.0,
            "min_vel_theta": 0.5, "acc_lim_x": 2.5, "acc_lim_y": 0.0, "acc_lim_theta": 3.2,
            "xy_goal_tolerance": 0.15, "yaw_goal_tolerance": 0.5, "sim_time": 1.5,
            "vx_samples": 10, "vy_samples": 0, "vth_samples": 20,
        },
    },
}  # fmt: skip
"""A differential configuration that drives well, faster than that of the paper."""


def configured(**changes):
    """Return the configuration with values changed, ``move_base__planner_patience=1.0``."""
    tree = copy.deepcopy(dict(DIFFERENTIAL))
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
