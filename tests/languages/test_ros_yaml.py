"""ROS parameter files: read as ROS reads them, slips reported where they stand."""

import itertools

import pytest

from grammars.text.diagnostics import InputError
from grammars.text.ros_yaml import parse_ros_yaml
from tests.languages.plans import answers


def meaning(text):
    """Return the parameters of a text, its warnings or errors, in one line."""
    try:
        document, findings = parse_ros_yaml(text.replace("\\n", "\n"), "f.yaml")
    except InputError as error:
        return " | ".join(map(str, error.findings)).replace("\n   ", ",")
    return " | ".join([repr(document.data), *map(str, findings)]).replace("\n   ", ",")


def test_texts_have_the_values_that_rosparam_gives_them_or_are_refused(golden):
    golden("tables/ros_yaml.txt", answers("tables/ros_yaml.txt", meaning))


def test_every_value_knows_its_place():
    document, _ = parse_ros_yaml("a:\n  b: [[1, 2],\n      [3, 4]]\n", "f.yaml")
    assert str(document.where(("a", "b"))) == "f.yaml:2:6"
    assert str(document.where(("a", "b", 1))) == "f.yaml:3:7"


@pytest.mark.parametrize("sign", "\u2028\u2029\x85")
def test_lines_are_those_that_an_editor_counts(sign):
    document, warnings = parse_ros_yaml(f"a: 'x{sign}y'\nb: 1\nb: 2\n", "f.yaml")
    assert str(document.where(("b",))) == "f.yaml:3:4"
    assert str(warnings[0].where) == "f.yaml:3:1"


def test_aliases_of_aliases_end():
    names = "abcdefgh"
    lines = ["a: &a [1, 2]"] + [
        f"{name}: &{name} [{', '.join([f'*{above}'] * 10)}]"
        for above, name in itertools.pairwise(names)
    ]
    assert "holds more than" in meaning("\n".join(lines))
