"""The pilot in the simulated world: real contacts, real doors, real odometry noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.model.sut import Briefing, LaserScan, Observation
from daemon.simulator import World
from daemon.stacks.registry import make_sut
from grammars.floorplan import load_floorplan
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission
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
        self.events = []
        self.contacts = 0
        self.estimates = []
        while world.time < limit:
            scans = (LaserScan(world.time, world.scan()),) if world.tick % 10 == 0 else ()
            seen = Observation(world.time, (world.odometry(),), scans)
            decision = pilot.update(seen)
            self.events += decision.events
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


def test_it_visits_every_room_of_the_demo_flat(campaigns):
    mission, _ = load_mission(campaigns / "demo" / "courier.mission.yaml")
    robot = load_robot(campaigns / "robots" / "courier.yaml")
    drive = Drive(campaigns / "demo", "flat", "doors_open", mission, robot, 180.0)
    assert drive.progress.state == "succeeded"
    assert drive.contacts == 0
    assert drive.worst_error < 0.1
    assert drive.inside_two_sigma > 0.95


@pytest.mark.parametrize("doors", ["doors_closed", "doors_random"])
def test_it_drives_the_long_corridor_of_building_c(campaigns, doors):
    mission, _ = load_mission(campaigns / "ortega2024" / "corridor.mission.yaml")
    robot = load_robot(campaigns / "robots" / "robile.yaml")
    drive = Drive(campaigns / "ortega2024", "building_c", doors, mission, robot, 600.0)
    assert drive.progress.state == "succeeded"
    assert drive.contacts == 0
    assert drive.worst_error < 0.15
    assert drive.inside_two_sigma > 0.95


def test_it_says_that_a_shut_classroom_cannot_be_reached(campaigns):
    mission, _ = load_mission(campaigns / "ortega2024" / "corridor.mission.yaml")
    start = Pose2(44.4, 43.85, 0.0)
    inside = replace(mission.waypoints[0], x=49.54, y=33.41)
    closed = Mission("shut", start, (inside,))
    robot = load_robot(campaigns / "robots" / "robile.yaml")
    drive = Drive(campaigns / "ortega2024", "building_c", "doors_closed", closed, robot, 200.0)
    assert drive.progress.state == "aborted"
    assert drive.contacts == 0
    assert drive.events[-1] == "giving up: no way to waypoint 1"
