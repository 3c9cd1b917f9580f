"""What is written into a plan's text: the value, at its place, and nothing else."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import parse_floorplan
from grammars.text.diagnostics import InputError
from grammars.text.expressions import evaluate
from grammars.text.units import read_unit
from grammars.variation import parse_variation, sample
from grammars.variation.plan_text import PlanText, SlotValue, rewrite
from tests.languages.plans import HOUSE, answers, one_variant, vary
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
    return evaluate(slot.value, lambda name: value(plan, plan.variables[name.name]))


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


def test_values_are_written_as_people_would_or_refused(golden, tmp_path):
    def written(statement):
        try:
            lines = one_variant(tmp_path, statement).text.splitlines()
        except InputError as error:
            return " | ".join(map(str, error.findings)).replace("\n   ", ",")
        return " | ".join(line.strip() for line in lines[2:] if line not in HOUSE.splitlines())

    golden("tables/writing.txt", answers("tables/writing.txt", written))
