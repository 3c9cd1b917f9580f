"""What is written into a plan's text: the value, at its place, and nothing else."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import parse_floorplan
from grammars.text.diagnostics import InputError
from grammars.text.units import read_unit
from grammars.variation import parse_variation, sample
from grammars.variation.plan_text import PlanText, SlotValue, rewrite
from tests.languages.plans import HOUSE, one_variant, vary
from tests.parts import ROOT

SOURCES = {
    "house": HOUSE,
    "house with carriage returns": HOUSE.replace("\n", "\r\n"),
    "flat": (ROOT / "campaigns" / "demo" / "flat.fpm").read_text(encoding="utf-8"),
}
PLANS = {name: PlanText(text, "plan.fpm") for name, text in SOURCES.items()}
NUMBERS = st.floats(0.01, 9.0).map(lambda v: round(v, 4))


def slots(plan):
    """Return every slot of a plan by its name; not all are written."""
    actual = dict(plan.variables)
    for elements in plan.elements.values():
        for element in elements:
            for path in element.paths():
                slot = plan.slot(element, path)
                assert slot is not None
                actual[slot.name] = slot
    return actual


def value(plan, slot):
    if isinstance(slot.value, float):
        return slot.value
    return slot.value.sign * value(plan, plan.variables[slot.value.variable])


def comments(text):
    return re.findall(r"//[^\r\n]*", text)


@st.composite
def edits(draw):
    plan = PLANS[draw(st.sampled_from(sorted(PLANS)))]
    known = {name: slot for name, slot in slots(plan).items() if slot.number}
    names = draw(st.lists(st.sampled_from(sorted(known)), min_size=1, max_size=8, unique=True))
    chosen = {}
    for name in names:
        units = ["", "m"] if known[name].kind == "length" else ["", "deg", "rad"]
        chosen[name] = SlotValue(known[name], draw(NUMBERS), draw(st.sampled_from(units)))
    return plan, chosen


@given(edits())
def test_values_arrive_at_their_places_and_nowhere_else(edit):
    plan, settings_ = edit
    text = rewrite(plan, settings_.values())
    after = PlanText(text, "variant.fpm")
    before = slots(plan)
    for name, slot in slots(after).items():
        setting = settings_.get(name)
        if setting is not None:
            expected = setting.number * read_unit(setting.unit or setting.slot.unit)[0]
        elif isinstance(slot.value, float) and name not in settings_:
            expected = value(plan, before[name])
        else:
            assert slot.value == before[name].value
            continue
        assert value(after, slot) == pytest.approx(expected, abs=1e-12), name
    assert sorted(comments(text)) == sorted(comments(plan.text))
    assert text.count("\r") == ("\r" in plan.text) * text.count("\n")


@given(edits())
def test_everything_but_the_values_stays_as_it_was(edit):
    plan, settings_ = edit
    text = rewrite(plan, settings_.values())
    literal = r"(?:[+-]\s*)?(?:\d+\.?\d*|\.\d+)\s*(?:m|deg|rad)?(?!\w)"
    number = literal + r"|(?:-\s*)?(?:gap|turn|reach|\w+_\w+)"
    assert re.sub(number, "#", text).split() == re.sub(number, "#", plan.text).split()
    assert text.count("\n") == plan.text.count("\n")


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_every_plan_can_be_varied_everywhere_and_compiles(name):
    plan = PLANS[name]
    safe = {"length": 0.35, "angle": 0.0}
    chosen = [SlotValue(slot, safe[slot.kind]) for slot in slots(plan).values() if slot.number]
    compiled = parse_floorplan(rewrite(plan, chosen, name="renamed"))
    assert compiled.name == "renamed"
    assert 0.35 in {wall.thickness for wall in compiled.walls}


def test_comment_lines_name_the_plan_the_seed_and_the_design(tmp_path):
    variation = vary(tmp_path, "gap: uniform([1.0, 1.2])")
    for options, seed in (({}, "// Seed: 7"), ({"method": "lhs"}, "// Seed: 7, lhs design 7")):
        (variant,) = sample(variation, 1, seed=7, **options)
        assert variant.text.splitlines()[:3] == [
            "// Source plan: house (plan.fpm)",
            seed,
            HOUSE.splitlines()[0],
        ]


def test_a_strange_file_name_stays_inside_its_comment(tmp_path):
    name = "a\rFloor plan\u2028.fpm"
    (tmp_path / name).write_bytes(HOUSE.encode())
    text = f'import "{name}" gap: uniform([1])'
    variant = sample(parse_variation(text, "test.variation", tmp_path), 1, seed=1)[0]
    assert variant.text.splitlines()[0] == "// Source plan: house (a Floor plan .fpm)"


@pytest.mark.parametrize(
    ("statement", "line"),
    [
        # A literal keeps the unit it was written in.
        ("turn: uniform([45.0])", "var turn = 45.0 deg"),
        ("hall.pillar: {height: uniform([2])}", "height: 2.0"),
        # A unit of the variation replaces the one written.
        ("turn: uniform([0.5 rad])", "var turn = 0.5 rad"),
        ("hall.pillar: {height: uniform([2 m])}", "height: 2.0 m"),
        # A use of a variable is replaced there alone, with its sign.
        ("room: {shape.length: uniform([2])}", "shape: Rectangle width=3.0 m, length=2.0 m"),
        ("room: {shape.length: uniform([2])}", "shape: Rectangle width=gap, length=0.1 m"),
        (
            "hall.screen: {location.translation.x: uniform([0.5])}",
            "location: wrt: this rotation: z: turn translation: x: 0.5 m, y: 1 m",
        ),
    ],
)
def test_values_are_written_as_people_would(tmp_path, statement, line):
    assert line in map(str.strip, one_variant(tmp_path, statement).text.splitlines())


UNWRITTEN = {
    "hall.pillar: {location.translation.x: uniform([0.5])}": "translation: x: 0 m",
    "hall: {location.translation.y: uniform([2])}": "translation: y: 0 m",
    "hall.pillar: {location.rotation.z: uniform([90 deg])}": "rotation: z: 0 deg",
    "door: {location.translation.x: uniform([1])}": "translation: x: 0 m",
    "closet: {defaults.wall.thickness: uniform([0.35])}": "walls: thickness: 0.2 m",
    "room: {defaults.wall.height: uniform([3])}": "walls: height: 2.5 m",
}


@pytest.mark.parametrize("statement", UNWRITTEN)
def test_what_is_not_written_in_the_plan_is_not_varied(tmp_path, statement):
    with pytest.raises(InputError) as caught:
        vary(tmp_path, statement)
    (problem,) = caught.value.findings
    assert (problem.where.line, problem.where.column) == (2, statement.find("{") + 2)
    assert problem.message.endswith(" is not written in the plan")
    assert problem.hint == f'write "{UNWRITTEN[statement]}" there, then vary it'


@pytest.mark.parametrize("statement", UNWRITTEN)
def test_what_is_not_written_can_be_asked_about(tmp_path, statement):
    target, path = re.match(r"([\w.]+): \{([\w.]+)", statement).groups()
    written = re.search(r"[\d.]+", UNWRITTEN[statement])[0]
    one_variant(tmp_path, f"gap: uniform([1.0]) require {target}.{path} == {written}")
