"""The pilot in the simulated world: real contacts, real doors, real odometry noise."""

import math

import numpy as np
import pytest

from daemon.model.sut import Briefing, LaserScan, Observation
from daemon.simulator import World
from daemon.stacks.registry import make_sut
from grammars.floorplan import load_floorplan
from grammars.model.mission_files import load_mission
from grammars.model.robot_files import load_robot
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from templates.occupancy import occupancy_grid


class Drive:
    """A drive in a campaign's building, from the first tick to the end of the mission."""

    def __init__(self, folder, plan, doors, mission, robot, limit):
        layers = [load_scenery(folder / f"{name}.scenery") for name in ("doors", doors)]
        scene = compile_scene(load_floorplan(folder / f"{plan}.fpm"), layers)
        seed = np.random.SeedSequence(7)
        behaviours = resolve_behaviours(scene, layers, seed=seed, limit=limit).behaviours
        world = World(scene, robot, mission.start, behaviours, seed)
        grid = occupancy_grid(scene, laser_height=robot.laser.z)
        pilot = make_sut("pilot", {})
        pilot.start(Briefing(robot, grid, mission, mission.start, seed))
        self.contacts = 0
        self.estimates = []
        while world.time < limit:
            scans = (LaserScan(world.time, world.scan()),) if world.tick % 10 == 0 else ()
            seen = Observation(world.time, (world.odometry(),), scans)
            decision = pilot.update(seen)
            self.contacts += len(world.take_contacts())
            if decision.estimate is not None:
                self.estimates.append((world.pose(), decision.estimate))
            if decision.progress.state != "active":
                break
            world.command(decision.command)
            world.advance(5)
        self.progress = decision.progress

    @property
    def worst_error(self):
        """Largest distance between estimate and truth [m]."""
        return max(math.hypot(t.x - e.pose.x, t.y - e.pose.y) for t, e in self.estimates)

    @property
    def inside_two_sigma(self):
        """Share of estimates with x and y both within two standard deviations of the truth."""
        inside = [
            abs(t.x - e.pose.x) <= 2.0 * math.sqrt(e.covariance[0, 0])
            and abs(t.y - e.pose.y) <= 2.0 * math.sqrt(e.covariance[1, 1])
            for t, e in self.estimates
        ]
        return float(np.mean(inside))


@pytest.mark.parametrize(
    ("folder", "plan", "doors", "route", "robot", "limit"),
    [
        ("demo", "flat", "doors_open", "courier", "courier", 180.0),
        ("ortega2024", "building_c", "doors_random", "corridor", "robile", 600.0),
    ],
)
def test_it_drives_a_whole_mission(campaigns, folder, plan, doors, route, robot, limit):
    mission, _ = load_mission(campaigns / folder / f"{route}.mission.yaml")
    robot = load_robot(campaigns / "robots" / f"{robot}.yaml")
    drive = Drive(campaigns / folder, plan, doors, mission, robot, limit)
    assert drive.progress.state == "succeeded"
    assert drive.contacts == 0
    assert drive.worst_error < 0.15
    assert drive.inside_two_sigma > 0.95
