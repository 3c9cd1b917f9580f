"""Building C as the planner sees it, and the starts and goals of scenario S1."""

import math
from pathlib import Path

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from grammars.floorplan import load_floorplan
from grammars.model.geometry import Pose2
from grammars.model.grid import OCCUPIED
from grammars.model.mission_files import load_mission
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid

FOLDER = Path(__file__).parents[4] / "campaigns" / "ortega2024"
INSCRIBED_RADIUS, INFLATION_RADIUS, SCALING = 0.085, 0.5, 3.0
"""[m, m, 1/m] The global costmap of a2s."""


def costmap():
    """Return the inflated map of building C with the doors of S1."""
    from scipy.ndimage import distance_transform_edt

    doors = load_scenery(FOLDER / "doors_s1.scenery")
    scene = compile_scene(load_floorplan(FOLDER / "building_c.fpm"), [doors])
    grid = occupancy_grid(scene, laser_height=0.3)
    away = distance_transform_edt(grid.cells != OCCUPIED) * grid.resolution
    costs = (252.0 * np.exp(-SCALING * (away - INSCRIBED_RADIUS))).clip(max=252.0).astype(np.uint8)
    costs[away > INFLATION_RADIUS] = 0
    costs[away <= INSCRIBED_RADIUS] = 253
    costs[away == 0.0] = 254
    return CostGrid(grid.resolution, grid.x, grid.y, costs)


def drive(step):
    """Return start and goal of each plan on straight lines between the waypoints of S1.

    ``step`` [m] is what the robot moves between two plans.
    """
    mission, _ = load_mission(FOLDER / "corridor.mission.yaml")
    here, trips = (mission.start.x, mission.start.y), []
    for waypoint in mission.waypoints:
        there = (waypoint.x, waypoint.y)
        count = max(1, round(math.dist(here, there) / step))
        for share in np.linspace(0.0, 1.0, count, endpoint=False).tolist():
            x, y = (a + share * (b - a) for a, b in zip(here, there, strict=True))
            trips.append((Pose2(x, y), Pose2(*there, waypoint.yaw or 0.0)))
        here = there
    return trips
