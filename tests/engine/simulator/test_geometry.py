"""Distances and masses of parts against shapely and plain formulas, seen from outside."""

import math
from dataclasses import replace

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Jump, KeyFrame, KeyFrames, Spring, Trigger
from grammars.model.geometry import Pose2
from grammars.model.scene import Doorway
from tests.engine.simulator.scenes import ROBOT, box, door, world

coordinates = st.floats(-5.0, 5.0).map(lambda v: round(v, 6))
poses = st.builds(Pose2, coordinates, coordinates, st.floats(-3.0, 3.0))
WAY = box(2.9, 0.5, 3.1, 1.5)


@given(at=poses, start=poses, of=st.sampled_from(["hinge", "foot", "leaf", "doorway"]))
def test_a_trigger_measures_from_what_it_names(at, start, of):
    item = door("d", at, doorway="way")
    things = {
        "hinge": shapely.Point(at.apply((-0.025, 0.025))),
        "foot": shapely.Point(at.x, at.y),
        "leaf": shapely.Polygon(at.apply_ring(item.links[1].polygons[0])),
        "doorway": shapely.Polygon(WAY).centroid,
    }
    robot = {
        "base": shapely.Point(start.x, start.y),
        "footprint": shapely.Polygon(start.apply_ring(ROBOT.footprint)),
    }
    for to, outline in robot.items():
        trigger = Trigger("d.hinge", 0.0, 1.4, 30.0, Jump(), of=of, to=to)
        doorway = Doorway("way", Pose2(3.0, 0.0, 0.0), WAY, 1.0, 0.0, 2.0)
        simulated = world(item, doorway, start=start, behaviours=(trigger,))
        simulated.advance(1)
        event = simulated.take_events()[0]
        expected = shapely.distance(things[of], outline)
        assert float(event.text.split()[2]) == pytest.approx(expected, abs=6e-4)


def swing(pieces, mass):
    """The angle of a leaf of these pieces, drawn to 1.4 rad by a spring, at every tick."""
    item = door("d", Pose2(5.0, 0.0, 0.0), mass=mass)
    post, leaf = item.links
    item = replace(item, links=(post, replace(leaf, polygons=pieces)))
    spring = KeyFrames("d.hinge", (KeyFrame(0.0, 0.0), KeyFrame(0.05, 1.4)), Spring(2.0))
    simulated = world(item, behaviours=(spring,))
    for _ in range(150):
        simulated.advance(1)
        yield float(simulated.joint_positions()[0])


def test_a_leaf_in_pieces_swings_like_the_leaf_in_one_and_as_its_inertia_says():
    whole = box(-0.025, 0.035, 0.025, 0.965)
    pieces = box(-0.025, 0.035, 0.025, 0.4), box(-0.025, 0.4, 0.025, 0.965)[::-1]
    angles = list(swing((whole,), 10.0))
    assert list(swing(pieces, 10.0)) == pytest.approx(angles, abs=1e-6)
    # A beam about its hinge, 0.475 m along and 0.025 m beside its middle.
    inertia = 10.0 * ((0.93**2 + 0.05**2) / 12.0 + 0.475**2 + 0.025**2)
    for tick, angle in enumerate(angles[:100], start=1):
        turned = 1.4 * (1.0 - math.cos(math.sqrt(2.0 / inertia) * max(0.0, tick / 100 - 0.05)))
        assert angle == pytest.approx(turned, abs=0.02)
