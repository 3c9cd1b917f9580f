"""Shapes of a world seen from above: what they are, and where."""

import math
from dataclasses import replace

import numpy as np
import pytest

from grammars.model.behaviour import start_positions
from grammars.model.geometry import Pose2
from grammars.model.movers import with_planar_chain
from grammars.model.scene import Link, SceneObject
from templates import plan_shapes
from templates.plan_shapes import ShapeRole, trail_shapes
from tests.scene.templates.worlds import box, world


def lines(shapes):
    return {s.role: [[(x, y) for x, y in part] for part in s.parts] for s in shapes}


WAY = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0))


def test_a_trail_is_cut_where_its_clearance_crosses_the_limit():
    found = lines(list(trail_shapes(WAY, (1.0, 0.9, 0.1, 0.0, math.nan), limit=0.2)))
    assert found == {
        ShapeRole.TRAIL: [[(0.0, 0.0), (1.0, 0.0)]],
        ShapeRole.NEAR_TRAIL: [[(1.0, 0.0), (2.0, 0.0)]],
        ShapeRole.TOUCHING_TRAIL: [[(2.0, 0.0), (3.0, 0.0), (4.0, 0.0)]],
    }


@pytest.mark.parametrize("clearances", [(), (0.1, 0.1), (math.nan,) * 5])
def test_a_trail_of_unknown_clearance_is_one_line(clearances):
    assert lines(list(trail_shapes(WAY, clearances, limit=0.2))) == {ShapeRole.TRAIL: [list(WAY)]}


def test_without_a_limit_only_touching_stands_out():
    found = lines(list(trail_shapes(WAY, (1.0, 0.01, 0.01, 0.01, -0.1))))
    assert set(found) == {ShapeRole.TRAIL, ShapeRole.TOUCHING_TRAIL}
    assert found[ShapeRole.TOUCHING_TRAIL] == [[(3.0, 0.0), (4.0, 0.0)]]


def test_a_point_is_no_trail():
    assert list(trail_shapes(WAY[:1], (0.1,), limit=0.2)) == []


def test_the_spread_holds_two_standard_deviations_along_each_axis():
    shape = plan_shapes.spread_shape(Pose2(1.0, 2.0), (0.04, 0.0, 0.01))
    around = np.asarray(shape.parts[0]) - (1.0, 2.0)
    assert np.abs(around).max(axis=0) == pytest.approx([0.4, 0.2])


def test_waypoints_are_numbered_and_the_first_are_reached():
    mission = world().mission
    assert mission is not None
    found = [(s.role, s.text) for s in plan_shapes.waypoint_shapes(mission, 1)]
    assert found[:2] == [(ShapeRole.REACHED, "1"), (ShapeRole.WAYPOINT, "2")]
    assert len(found) == len(mission.waypoints)


def test_everything_in_the_plan_has_its_role():
    scene = world().scene
    start = start_positions(scene, world().draws[0].behaviours)
    solids = {shape.role for shape in plan_shapes.solid_shapes(scene, 1.2)}
    assert solids == {ShapeRole.WALL, ShapeRole.LOW}
    bodies = {shape.text: shape.role for shape in plan_shapes.body_shapes(scene, start)}
    assert set(bodies) == {thing.name for thing in scene.objects if thing.links[0].polygons}
    assert ShapeRole.DOOR in bodies.values()
    assert [s.text for s in plan_shapes.space_names(scene)] == [r.name for r in scene.regions]


def test_a_plan_leaves_out_what_its_height_does_not_cross():
    scene = world().scene
    start = start_positions(scene, world().draws[0].behaviours)
    assert list(plan_shapes.body_shapes(scene, start, cut=50.0)) == []
    assert list(plan_shapes.solid_shapes(scene, cut=-50.0)) == []


def test_whoever_walks_is_seen_at_any_height_and_named_as_such():
    trunk = Link("trunk", (box(-0.2, -0.1, 0.2, 0.1),), 4.0, 0.0, 0.25)
    links, joints = with_planar_chain((trunk,), (), "trunk")
    cat = SceneObject("tom", "cat", Pose2(1.0, 1.0), links, joints, (0.0, 0.0, 0.0))
    scene = replace(world().scene, objects=(cat,))
    (body,) = plan_shapes.body_shapes(scene, {"tom.x": 2.0}, cut=0.3)
    assert (body.role, body.text) == (ShapeRole.MOVER, "tom")
    assert np.mean(body.parts[0], axis=0) == pytest.approx([3.0, 1.0])
    (name,) = plan_shapes.object_names(scene, {})
    assert name.role is ShapeRole.MOVER_NAME
