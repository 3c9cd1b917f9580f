"""What a variation cannot mean is refused: where, what, and what to do."""

from pathlib import Path

import pytest

from grammars.text.diagnostics import InputError
from grammars.variation import load_variation, parse_variation
from tests.grammars.variation.plans import HOUSE, vary

OTHERWISE = {
    "room: {shape.widht: uniform([1])}": ('no "shape.widht"', 'did you mean "shape.width"? it has'),
    "room: {width: uniform([1])}": ('no "width"', 'did you mean "shape.width"?'),
    "room: {shape.coordinates: uniform([1])}": ('no "shape.coordinates"', "it has: shape.width"),
    "room: {shape.radius: uniform([1])}": ("", "shape.width, shape.length, location.translation.x"),
    "room: {location.transformation.translation.x: uniform([1])}": ("", '"location.translation.x"'),
    "room: {location.pose.translation.x: uniform([1])}": ("", '"location.translation.x"'),
    "room: {pose.translation.x: uniform([1])}": ("", '"location.translation.x"'),
    "room: {wall_thickness: uniform([1])}": ("", '"defaults.wall.thickness"'),
    "room: {walls.height: uniform([1])}": ("", '"defaults.wall.height"'),
    "room: {location.rotation.x: uniform([1])}": ('no "location.rotation.x"', "location.rotation"),
    "door: {location.translation.y: uniform([1])}": ("", "location.translation.z"),
    "closet: {shape.width: uniform([1])}": ("", "points are varied through variables"),
    "room: {location.translation.y: uniform([1])}": ("spaced", "wall thickness"),
    "romm: {shape.width: uniform([1])}": ('no "romm"', 'did you mean "room"?'),
    "pillar: {height: uniform([1])}": ('no "pillar"', "write hall.pillar"),
    "gap: {height: uniform([1])}": ('no "gap"', 'write "gap: uniform([…])"'),
    "house: {height: uniform([1])}": ('no "house"', "the plan itself"),
    "room: uniform([1])": ("no variable", 'say what to vary: "room: { … }"'),
    "gpa: uniform([1])": ('no variable "gpa"', 'did you mean "gap"?'),
    "room: {}": ('nothing of "room" is varied', "between the braces"),
    "gap: uniform([])": ("nothing to choose from", "uniform("),
    "gap: discrete([])": ("nothing to choose from", "discrete("),
    "gap: discrete([(0.5, 1), (0.4, 2)])": ("sum to 0.9", "sum to 1"),
    "gap: discrete([(1.5, 1), (-0.5, 2)])": ("is negative", "(probability, value)"),
    "gap: discrete([(1 m, 1)])": ("no unit", ""),
    "gap: uniform(2 .. 1)": ("2 .. 1 is empty", "smaller number"),
    "gap: uniform(1e7 .. 1e8)": ("too large", "1000 km"),
    "gap: uniform([1e999])": ("too large", "1000 km"),
    "gap: uniform([1 m, 2 rad])": ("m and rad", "once"),
    "gap: uniform([1 deg])": ("gap is a length, not an angle", "lengths are in m"),
    "gap: uniform([1 m^2])": ("nothing in a plan is in m^2", ""),
    "turn: uniform([1 m])": ("turn is an angle, not a length", "deg or rad"),
    "gap: normal(mean=1)": ("needs std", "normal(mean=1.0, std=0.2)"),
    "gap: normal(mean=1, sdt=1)": ('no "sdt"', 'did you mean "std"?'),
    "gap: normal(mean=1, mean=1, std=2)": ("given twice", ""),
    "gap: normal(mean=1, std=-1)": ("-1 is negative", ""),
    "gap: normal(mean=1, std=1e-12)": ("too small", ""),
    "gap: normal(mean=1, std=1, min=2, max=1)": ("min must be less than max", ""),
    "gap: normal(mean=1, std=0.01, min=5)": ("next to nothing", "move the limits"),
    "gap: normal(mean=1, std=0, min=5)": ("next to nothing", "move the limits"),
    "gap: uniform([1]) gap: uniform([2])": ("gap is already varied in line 2", ""),
    "gap: wide": ('no draw called "wide"', 'let wide = uniform("'[:-1]),
    "let wide = uniform([1]) gap: wid": ('no draw called "wid"', 'did you mean "wide"?'),
    "gap: room.area": ('no draw called "room.area"', "draws named by let"),
    "gap: distance(room, hall)": ("distributions and named draws, not of the plan", ""),
    "let a = 2": ("let names a distribution", "let a = uniform"),
    "let gap = uniform([1])": ("already the name", ""),
    "let a = uniform([1]) let a = uniform([1])": ("already named in line 2", ""),
    "require room.area > 2 m": ("compares m^2 with m", ""),
    "require turn > 2": ("compares rad with a number without unit", "rad: 2 rad"),
    "require gap + turn > 2": ("adds m and rad", ""),
    "require gap * turn + gap > 2": ("adds m rad and m", ""),
    "require roo.area > 2": ('no "roo"', 'did you mean "room"?'),
    "require room.aera > 2": ('no "aera"', 'did you mean "area"? it has: area, perimeter'),
    "require room > 2": ('"room" is a space', "it has: area"),
    "require gpa > 2": ('no draw or variable called "gpa"', 'did you mean "gap"?'),
    "require distance(room) > 2": ("distance takes two elements", "distance(hall.pillar, door)"),
    "require distance(room, 2 * hall) > 2": ("distance takes two elements", ""),
    "require distance(room, hal) > 2": ('no "hal"', 'did you mean "hall"?'),
    "require abs(1, 2) > 2": ("abs takes one number", ""),
    "require 1e999 > 2": ("1e999 is too large", ""),
    "require gap > 0": ("nothing is varied", "NAME: uniform"),
    'import "plan.fpm" gap: uniform([1])': ("varies one plan", "one file per plan"),
    "gap: unifrom([1])": ('unexpected "["', 'did you mean "uniform"?'),
    "gap: uniform([1,])": ('unexpected "]"', "no comma"),
    "gap: uniform(1, 2)": ('unexpected ","', "a range uniform(1.0 .. 2.0)"),
    "gap: uniform([1.0m])": ("unexpected", "a blank between a number and its unit"),
    "gap: uniform([1.0 ft])": ('unexpected "ft"', "lengths are in m, cm or mm"),
    "gap uniform([1])": ('unexpected "uniform"', ""),
    "gap: uniform([1]), turn: uniform([1])": ('unexpected ","', "not separated by commas"),
    "# gap": ('unexpected "#"', "comments start with //"),
    "require gap": ("not something true or false", ""),
    "room: {shape.width: uniform([1])": ('expected', ""),
    "gap: uniform([1]": ("expected", ""),
}  # fmt: skip


def refused(folder, statements):
    with pytest.raises(InputError) as caught:
        vary(folder, statements)
    for diagnostic in caught.value.diagnostics:
        assert diagnostic.where.file == "test.variation"
        assert diagnostic.where.line >= 1
        assert diagnostic.where.column >= 1
    return [str(d) for d in caught.value.diagnostics]


@pytest.mark.parametrize("statements", OTHERWISE)
def test_what_has_no_meaning_is_explained(tmp_path, statements):
    first = refused(tmp_path, statements)[0]
    message, hint = OTHERWISE[statements]
    assert message in first
    assert hint in first


def test_every_problem_is_reported_at_its_place(tmp_path):
    found = refused(
        tmp_path,
        "room: {\n    shape.widht: uniform([1])\n    shape.length: uniform([])\n}\nrequire a > b\n",
    )
    assert [line.split(": ")[0] for line in found] == [
        "test.variation:3:5",
        "test.variation:4:19",
        "test.variation:6:9",
        "test.variation:6:13",
    ]


def test_every_statement_that_cannot_be_read_is_reported(tmp_path):
    statements = """gap: unifrom([1])
let wide uniform([1])
room: { shape.width = 4 }
require gap
turn: uniform([1, 2)
pane: { height uniform([1]) }
"""
    lines = [d.split(":")[1] for d in refused(tmp_path, statements)]
    assert lines == ["2", "3", "4", "6", "7"]


def test_a_draw_that_nothing_uses_is_worth_a_word(tmp_path):
    variation = vary(tmp_path, "let wide = uniform([1]) gap: uniform([1])")
    assert 'the draw "wide" is never used' in [w.message for w in variation.warnings]


def test_a_space_and_an_opening_of_one_name_are_ambiguous(tmp_path):
    plan = HOUSE.replace("Entryway door", "Entryway room")
    with pytest.raises(InputError, match='"room" is the name of a space and an entryway'):
        vary(tmp_path, "room: {shape.width: uniform([1])}", plan)


def test_a_variation_starts_with_an_import(tmp_path):
    (tmp_path / "plan.fpm").write_text(HOUSE)
    with pytest.raises(InputError, match="1:1: imports no plan"):
        parse_variation("gap: uniform([1])", "test.variation", tmp_path)
    with pytest.raises(InputError, match="1:1: imports no plan"):
        parse_variation("// nothing yet\n", "test.variation", tmp_path)
    with pytest.raises(InputError, match="the import comes first"):
        parse_variation('gap: uniform([1]) import "plan.fpm"', "test.variation", tmp_path)
    with pytest.raises(InputError, match="a variation starts with the plan it varies"):
        parse_variation("{", "test.variation", tmp_path)


def test_a_missing_plan_suggests_those_that_are_there(tmp_path):
    (tmp_path / "plan.fpm").write_text(HOUSE)
    for name in ("plam.fpm", "pl\0an.fpm", "plam"):
        with pytest.raises(InputError, match='did you mean "plan.fpm"'):
            parse_variation(f'import "{name}" gap: uniform([1])', "test.variation", tmp_path)
    with pytest.raises(InputError, match="there is no plan"):
        parse_variation("import '' gap: uniform([1])", "test.variation", tmp_path)


def test_problems_of_the_plan_are_reported_in_the_plan(tmp_path):
    with pytest.raises(InputError) as caught:
        vary(
            tmp_path, "gap: uniform([1])", HOUSE.replace("wrt: hall.walls[1]", "wrt: hal.walls[1]")
        )
    where = caught.value.diagnostics[0].where
    assert Path(where.file).name == "plan.fpm"
    assert where.line > 1


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.variation: no such file"):
        load_variation(tmp_path / "none.variation")
    (tmp_path / "bad.variation").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bad\.variation: the variation is not UTF-8"):
        load_variation(tmp_path / "bad.variation")


@pytest.mark.parametrize(
    "text", ["(" * 2000 + "1", "-" * 4000 + "1", "abs(" * 500 + "1" + ")" * 500]
)
def test_monsters_are_refused(tmp_path, text):
    assert refused(tmp_path, f"gap: {text}")
    assert refused(tmp_path, f"require {text} > 2")
