"""Oracles: what is read of each, and binding to a scene, whose doors and movers they speak of."""

import dataclasses
import math
import re
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.behaviour import Hold
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.movers import with_planar_chain
from grammars.model.robot_files import load_robot
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from grammars.oracle import (
    SIGNALS,
    RunOutline,
    check_bounds,
    check_references,
    compared_limits,
    load_oracles,
    margin_kind,
    parse_oracle,
)
from grammars.oracle._bounds import _quantity, signal_bound
from grammars.text.diagnostics import InputError, Where
from grammars.text.expressions import Name, Number, evaluate, render
from tests.languages.plans import HERE, answers
from tests.parts import ROOT


def parse(text):
    return parse_oracle("it", text, Where("o.yaml", 1, 1))


def outline(node):
    """Return a node of an expression as text, each name and number with its column."""
    if isinstance(node, Number):
        return f"{node.value:.15g} {node.dimension.unit}@{node.column}"
    if isinstance(node, Name):
        return f"{node.name}@{node.column}" + "".join(f"<{outline(a)}>" for a in node.arguments)
    if isinstance(node, tuple):
        return ", ".join(map(outline, node))
    if not dataclasses.is_dataclass(node):
        return "-" if node is None else str(node)
    parts = [getattr(node, f.name) for f in dataclasses.fields(node) if f.name != "column"]
    return f"{type(node).__name__}({', '.join(map(outline, parts))})"


def description(text):
    oracle = parse(text)
    assert oracle.text == text
    lines = [text, outline(oracle.judgement)]
    lines += [f"when {outline(oracle.guard)} = {render(oracle.guard)}"] * (oracle.guard is not None)
    lines += [f"{oracle.leg}"] * (oracle.leg is not None)
    lines += ["a measure"] * oracle.is_measure
    lines.append(f"signals: {' '.join(map(render, oracle.signals()))}")
    if margin := margin_kind(getattr(oracle.judgement, "predicate", None) or Name("contact")):
        lines.append(f"margin: {margin.unit}")
    limits = compared_limits(oracle)
    lines += [f"limit: {c.signal} {c.value:.15g} {c.against or 'either way'}" for c in limits]
    return "\n    ".join(map(str.rstrip, lines))


def test_oracles_are_read_as_they_are_meant(golden):
    """The golden file begins each part with an oracle."""
    parts = (HERE / "oracles.txt").read_text("utf-8").split("\n\n")
    assert len(parts) > 50
    golden("oracles.txt", "\n\n".join(description(p.split("\n")[0]) for p in parts) + "\n")


@pytest.mark.parametrize(
    "text",
    [
        f"never({'(' * 400}contact{')' * 400})",
        f"max({'-' * 900}speed)",
        f"never({'not ' * 900}contact)",
        f"max({'speed + ' * 400}speed)",
        "never(contact)" + " " * 987,
    ],
)
def test_monsters_are_refused_instead_of_exhausting_the_parser(text):
    with pytest.raises(InputError, match="nest|longer than 1000"):
        parse(text)


def test_a_long_or_deep_text_that_is_no_monster_is_read():
    assert parse("never(contact)" + " " * 986).text.startswith("never(contact)")
    parse(f"never({'(' * 15}contact{')' * 15})")


def test_every_declared_signal_can_be_used():
    for name, kind in SIGNALS.items():
        arguments = "(robot, door-17)" if kind.relates else "(Spin)" if kind.takes_node else ""
        signal = name + arguments
        parse(f"never({signal})" if kind.dimension is None else f"max({signal})")


def test_a_layer_keeps_the_order_of_its_file_and_folds_lines(tmp_path):
    path = tmp_path / "navigation.oracles.yaml"
    folded = "a: >-\n  always(loc.error <= 1 m)\n  when speed > 0 m/s\n"
    path.write_text(f"late: never(contact)\nearly: max(speed)   # a measure\n{folded}")
    oracles = load_oracles(path)
    assert list(oracles) == ["late", "early", "a"]
    assert oracles["early"].text == "max(speed)"
    assert oracles["a"].guard is not None


def leaf(name):
    return Link(name, (((0.0, 0.0), (1.0, 0.0), (1.0, 0.1)),), 10.0, 0.0, 2.0)


def hinge(name, child, kind="revolute"):
    return Joint(name, kind, "world", child, (0.0, 0.0), (1.0, 0.0), -2.0, 2.0)


def thing(name, *joints):
    links = tuple(leaf(joint.child) for joint in joints)
    return SceneObject(name, "thing", Pose2(), links, joints, (0.0,) * len(joints))


SCENE = Scene(
    "hall",
    (),
    (),
    (Solid("wall-3", "wall", ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1)), 0.0, 2.7),),
    (
        thing("door-17", hinge("hinge", "leaf")),
        thing("gate", hinge("left", "a", "prismatic"), hinge("right", "b", "prismatic")),
    ),
)
SOMEWHERE = Mission("m", Pose2(), (Waypoint("a", 1.0, 0.0),))


def findings(text, mission=SOMEWHERE, scene=SCENE):
    oracle = parse_oracle("it", text, Where("o.yaml", 1, 1))
    return [str(d) for d in check_references(oracle, scene, mission)]


PLACES = replace(
    SCENE,
    regions=(Region("kitchen", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))),),
    doorways=(Doorway("way", Pose2(), ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1)), 1.0, 0.0, 2.0),),
)


LINKS, JOINTS = with_planar_chain((leaf("body"),), (), "body")
VISITOR = SceneObject("visitor", "person", Pose2(), LINKS, JOINTS, (0.0,) * 3)
EVERYTHING = replace(PLACES, objects=(*PLACES.objects, VISITOR))
SIGNALS_OF_THINGS = """\
door-17.angle; door-17.hinge.angle; door-17.distance; gate.left.position; gate.right.distance
clearance(door-17); clearance(door-17.leaf); clearance(gate); clearance(wall-3)
distance(robot, door-17); distance(robot, door-17.leaf); distance(robot, gate)
distance(robot, wall-3); distance(robot, kitchen); distance(robot, way)
visitor.x.position + visitor.y.position; visitor.yaw.angle"""


@pytest.mark.parametrize("signal", re.split("; |\n", SIGNALS_OF_THINGS))
def test_things_have_signals(signal):
    assert findings(f"max({signal})", scene=EVERYTHING) == []


@pytest.mark.parametrize("name", ["door-17", "door-17.leaf", "gate", "wall-3", "kitchen", "way"])
def test_the_robot_is_in_places_and_in_contact_with_things(name):
    is_place = name in ("kitchen", "way")
    assert bool(findings(f"never(in(robot, {name}))", scene=EVERYTHING)) is not is_place
    assert bool(findings(f"never(contact({name}))", scene=EVERYTHING)) is is_place


ROBOT = load_robot(ROOT / "campaigns" / "robots" / "courier.yaml")


def undecidable(text, scene, *behaviours):
    """Return the findings about a run of 60 s at 0.5 m/s at most."""
    run = RunOutline(scene, ROBOT, SOMEWHERE, 60.0, 0.5, behaviours)
    oracle = parse_oracle("it", text, Where("o.yaml", 1, 1))
    said = " ".join(map(str, check_bounds(oracle, run))) or "nothing"
    return said.replace("\n   ", ",").replace("warning: ", "")


def limits(text):
    """Return what is said of a door that opens from 0 to 1.9 rad, and of its mirror image."""
    said = []
    for mirrored in (False, True):
        joint = replace(hinge("hinge", "leaf"), lower=-1.9 * mirrored, upper=1.9 * (not mirrored))
        scene = replace(SCENE, objects=(replace(thing("door-17", joint), mirrored=mirrored),))
        said.append(undecidable(text, scene))
    return " | ".join(said)


def test_what_a_door_cannot_come_to_is_warned_of(golden):
    golden("tables/limits.txt", answers("tables/limits.txt", limits))


def walls(*corners):
    sides = (((x, y), (u, v), (u + 0.1, v + 0.1)) for (x, y), (u, v) in pairwise(corners))
    return tuple(Solid(f"wall-{i}", "wall", ring, 0.0, 2.7) for i, ring in enumerate(sides))


CLOSED = ((-1.0, -1.0), (9.0, -1.0), (9.0, 5.0), (-1.0, 5.0), (-1.0, -1.0))
HALLS = {
    "open": replace(EVERYTHING, solids=walls(*CLOSED[:4])),
    "shut": replace(EVERYTHING, solids=walls(*CLOSED)),
    "still": replace(PLACES, objects=(replace(thing("door-17", hinge("h", "l")), frozen=True),)),
}
HELD = Hold("door-17.hinge", 0.0)


def bounds(text):
    """Return what is said in a hall: ``open`` to the outside, ``shut``, or with ``still`` doors."""
    name, _, oracle = text.partition(": ")
    return undecidable(oracle, HALLS[name], *([HELD] if name == "open" else []))


def test_what_no_run_can_change_is_warned_of(golden):
    golden("tables/bounds.txt", answers("tables/bounds.txt", bounds))


SIZES = (
    "speed",
    "elapsed * 1 m/s^2",
    "(mission.reached - 3) * 1 m/s",
    "-loc.error / 2 s",
    "0.5 m/s",
)
QUANTITIES = st.recursive(
    st.sampled_from(SIZES),
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-"), inner),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), inner, inner),
        st.builds("abs({})".format, inner),
        st.builds("({} * ({} / 1 m/s))".format, inner, inner),
        st.builds("({} / (({}) / 1 m/s))".format, inner, inner),
    ),
    max_leaves=5,
)


@given(QUANTITIES, st.data())
def test_the_bounds_of_a_quantity_hold_for_all_values_of_its_signals(text, data):
    run = RunOutline(HALLS["open"], ROBOT, SOMEWHERE, 60.0, 0.5)
    values = {}
    for name in ("speed", "elapsed", "mission.reached", "loc.error"):
        low, high = signal_bound(Name(name), run)[:2]
        high = min(high, 9.0)
        values[name] = data.draw(st.sampled_from([low, high]) | st.floats(low, high))
    quantity = parse(f"max({text})").judgement.signal
    value, (low, high) = (
        evaluate(quantity, lambda one: values[one.name]),
        _quantity(quantity, run)[:2],
    )
    rounding = 1e-6 * (1.0 + abs(value))
    assert math.isnan(value) or low - rounding <= value <= high + rounding
