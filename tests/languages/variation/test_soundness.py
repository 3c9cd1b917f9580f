"""A sound plan: rooms apart, openings inside of walls, every space within reach."""

from pathlib import Path

import pytest

from grammars.text.diagnostics import InputError, Severity
from grammars.variation import sample, source_defects
from tests.languages.variation.plans import vary

SOUND = """\
Floor plan: two
Defaults: walls: thickness: 0.2 m height: 2.5 m
var shift = 0 m
var wide = 1 m
Space a: shape: Rectangle width=5 m, length=4 m location: wrt: world of: this
    walls: thickness: 0.2 m
    features: Divider screen: shape: Rectangle width=1 m, length=0.1 m height: 2 m
        location: wrt: this translation: x: 0 m rotation: z: 0 deg
Space b: shape: Rectangle width=4 m, length=3 m
    location: wrt: a.walls[1] of: this.walls[3] spaced translation: x: shift rotation: z: 0 deg
Space c: shape: Rectangle width=4 m, length=3 m
    location: wrt: world of: this translation: y: -10 m
Entryway door: shape: Rectangle width=wide, height=2 m
    location: in: a.walls[1] and b.walls[3] translation: x: 0 m, z: 1 m
Entryway second: shape: Rectangle width=0.2 m, height=2 m
    location: in: a.walls[1] and b.walls[3] translation: x: 1 m, z: 1 m
Window pane: shape: Rectangle width=1 m, height=1 m
    location: in: a.walls[0] translation: z: 1.5 m, x: 0 m
"""

UNSOUND = {
    "c: {location.translation.y: uniform([-1])}": '"c" and "a" overlap',
    "shift: uniform([1.5])": "m beyond the end of b-wall-3",
    "wide: uniform([3.5])": "m beyond the end of b-wall-3",
    "door: {location.translation.z: uniform([0.9])}": '"door" reaches below the floor',
    "pane: {location.translation.z: uniform([2.1])}": '"pane" reaches above a-wall-0',
    "wide: uniform([2.5])": "door and second run into each other",
    "b: {location.rotation.z: uniform([0.2])}": "a-wall-1 and b-wall-3 do not face each other",
    "a: {defaults.wall.thickness: uniform([-0.1])}": "the walls of a have no thickness",
    "wide: uniform([0.55])": "b cannot be reached with a radius of 0.3 m",
    "a.screen: {shape.width: uniform([4.9]) location.rotation.z: uniform([90 deg]) "
    "location.translation.x: uniform([2.2])}": "cannot be reached with a radius of 0.3 m",
}
FINE = [
    "shift: uniform([0.2])",
    "wide: uniform([0.61])",
    "pane: {location.translation.x: uniform([2])}",
    "a: {defaults.wall.thickness: uniform([0.1, 0.4])}",
    "a.screen: {shape.width: uniform([4.9]) height: uniform([0.01])}",
    "c: {shape.length: uniform([2])}",
]


def check(folder, statements):
    variation = vary(folder, statements, SOUND)
    sample(variation, 1, seed=0, tries=2, check=0.3)
    return variation


@pytest.mark.parametrize("statements", UNSOUND)
def test_an_unsound_plan_is_rejected_with_its_reason(tmp_path, statements):
    with pytest.raises(InputError) as caught:
        check(tmp_path, statements)
    reasons = caught.value.findings[1:]
    assert any(UNSOUND[statements] in reason.message for reason in reasons)
    assert all(reason.where.line >= 1 for reason in reasons)
    assert all(Path(reason.where.file).name == "plan.fpm" for reason in reasons)


@pytest.mark.parametrize("statements", FINE)
def test_a_sound_plan_is_kept(tmp_path, statements):
    assert check(tmp_path, statements)


def test_defects_of_the_source_may_stay_but_are_said(tmp_path):
    warnings = source_defects(check(tmp_path, "shift: uniform([0.1])"), 0.3)
    assert [w.message for w in warnings] == ["c cannot be reached with a radius of 0.3 m"]
    assert all(w.severity is Severity.WARNING for w in warnings)


def test_an_overlap_of_the_source_may_stay_but_not_grow(tmp_path):
    overlapping = SOUND.replace("y: -10 m", "y: -3 m")
    statements = "c: {{location.translation.y: uniform([{}])}}"
    same = vary(tmp_path, statements.format(-3.2), overlapping)
    assert sample(same, 1, seed=0, check=0.3)
    worse = vary(tmp_path, statements.format(-2.5), overlapping)
    with pytest.raises(InputError, match='"c" and "a" overlap'):
        sample(worse, 1, seed=0, tries=1, check=0.3)


def test_unsound_draws_are_drawn_again(tmp_path):
    variation = vary(tmp_path, "shift: uniform(-3 .. 3) wide: uniform(0.4 .. 2)", SOUND)
    variants = sample(variation, 5, seed=0, check=0.3)
    assert any(v.tries > 1 for v in variants)
    for variant in variants:
        assert abs(variant.values[0].number) <= 1.01
        assert variant.values[1].number >= 0.6
