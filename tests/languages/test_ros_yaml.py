"""ROS parameter files: read as ROS reads them, slips reported where they stand."""

import itertools
import math

import pytest

from grammars.text.diagnostics import InputError
from grammars.text.ros_yaml import parse_ros_yaml


def read(text):
    return parse_ros_yaml(text, "f.yaml")[0].data


def problem(text):
    with pytest.raises(InputError) as caught:
        parse_ros_yaml(text, "f.yaml")
    return str(caught.value)


VALUES = [
    ("yes", True), ("off", False), ("010", 8), ("1.0e-3", 0.001), (".5", 0.5), ("0x10", 16),
    ("'1'", "1"), ("2020-01-01", "2020-01-01"), ("1.5e+0", 1.5), ("1.e-3", 0.001), ("1:30", 90),
    # Numbers that rosparam takes for text.
    ("1e-3", "1e-3"), ("1.5e0", "1.5e0"), ("1.0e3", "1.0e3"), ("1e+3", "1e+3"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "value"), VALUES)
def test_values_are_those_of_yaml_1_1_as_rosparam_reads_it(text, value):
    assert read(f"a: {text}\n") == {"a": value}
    assert type(read(f"a: {text}\n")["a"]) is type(value)


ANGLES = [
    ("!degrees 90", math.pi / 2), ("deg(180)", math.pi), ("rad(1.5)", 1.5), ("!radians 1", 1.0),
    ("rad(pi/2)", math.pi / 2), ("!radians -2*pi", -2 * math.pi), ("!radians rad(1 + 2)", 3.0),
    ("!degrees deg(90)", math.pi / 2),
]  # fmt: skip


@pytest.mark.parametrize(("text", "value"), ANGLES)
def test_angles_may_be_written_in_degrees_or_worked_out_of_pi(text, value):
    assert read(f"a: {text}\n") == pytest.approx({"a": value})


@pytest.mark.parametrize("text", ["rad(tau)", "rad(1/0)", "rad(pi**9)", "rad()", "deg(pi)"])
def test_what_is_no_angle_is_said_so(text):
    assert "is no angle" in problem(f"a: {text}\n")


def test_anchors_and_merges_are_followed_and_comments_set_nothing():
    assert read("# nothing\n") == {}
    text = "a: &x {b: 1, c: 2}\nd:\n  <<: *x\n  c: 3\ne: *x\n"
    assert read(text) == {"a": {"b": 1, "c": 2}, "d": {"b": 1, "c": 3}, "e": {"b": 1, "c": 2}}


def test_of_a_name_written_twice_the_last_value_counts_and_it_is_said():
    document, warnings = parse_ros_yaml("a: {b: 1}\nc: 2\na: 3\n", "f.yaml")
    assert document.data == {"a": 3, "c": 2}
    assert str(document.where(("a",))) == "f.yaml:3:4"
    assert [str(w) for w in warnings] == [
        "f.yaml:3:1: warning: a: is written twice, ROS takes this one\n    the other one: line 1"
    ]


def test_every_value_knows_its_place():
    document, _ = parse_ros_yaml("a:\n  b: [[1, 2],\n      [3, 4]]\n", "f.yaml")
    assert str(document.where(("a", "b"))) == "f.yaml:2:6"
    assert str(document.where(("a", "b", 1))) == "f.yaml:3:7"


@pytest.mark.parametrize("sign", "\u2028\u2029\x85")
def test_lines_are_those_that_an_editor_counts(sign):
    document, warnings = parse_ros_yaml(f"a: 'x{sign}y'\nb: 1\nb: 2\n", "f.yaml")
    assert str(document.where(("b",))) == "f.yaml:3:4"
    assert str(warnings[0].where) == "f.yaml:3:1"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: !!python/object/apply:os.system [ls]", "f.yaml:1:4"),
        ("a: !!python/name:os.system x", "is not read here"),
        ("a:", "f.yaml:1:1: a: has no value"),
        ("a: [~]", "f.yaml:1:5: is no value"),
        ("- 1", "f.yaml:1:1: expected parameters"),
        ("a: [1", "is not valid YAML"),
        ("a: &a [*a]", "is nested deeper"),
        pytest.param("[" * 1000, "f.yaml:1:22: is nested deeper than 20 levels", id="deep"),
        ("? [1]\n: 2", "a name must be plain text"),
        ("a: !degrees x", '"x" is no angle'),
        ("a: !!int x", '"x" is no int'),
        ("a: *b", "undefined alias"),
    ],
)
def test_what_cannot_be_read_is_reported_with_its_place(text, expected):
    assert expected in problem(text)


def test_aliases_of_aliases_end():
    names = "abcdefgh"
    lines = ["a: &a [1, 2]"] + [
        f"{name}: &{name} [{', '.join([f'*{above}'] * 10)}]"
        for above, name in itertools.pairwise(names)
    ]
    assert "holds more than" in problem("\n".join(lines))
