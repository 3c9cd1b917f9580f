"""Loops: the text that is read, the places of its messages, and a ward made of them."""

import shutil

from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import parse_floorplan, read_floorplan
from grammars.scenery import load_scenery, parse_scenery
from grammars.text.diagnostics import SourceText
from grammars.text.loops import repeated
from grammars.variation import parse_variation, sample
from scenario_tui.library.checking import check_file
from tests.languages.plans import HERE

WARD = HERE / "models" / "ward"


def test_a_ward_of_twelve_rooms_has_no_problems_and_few_lines(demo):
    folder = shutil.copytree(WARD, demo.parent / "ward")
    shutil.copy(demo / "navigation.oracles.yaml", folder)
    described, findings = check_file(folder / "ward.yaml")
    assert (described, findings) == ("1 scenario, 1 run", ())
    plan, layer = (
        read_floorplan(folder / "ward.fpm").compile(),
        load_scenery(folder / "ward.scenery"),
    )
    leaves = [one for one in layer.instances if one.model.text in ("room_door", "sliding_panel")]
    assert (len(plan.spaces), len(leaves), len(layer.instances)) == (13, 16, 40)
    files = ("ward.fpm", "ward.scenery", "automatic.scenery")
    assert sum(len((WARD / name).read_text().splitlines()) for name in files) <= 150


@given(
    st.integers(-3, 3),
    st.integers(0, 3),
    st.integers(0, 3),
    st.floats(-2, 2).map(lambda f: round(f, 3)),
)
def test_a_text_is_read_once_for_every_number(low, count, inner, step):
    text = (
        "door is a door at hall  // {not read}\n"
        f"for i in {low}..{low + count} {{\n"
        f"    a_{{i + 4}} is a bed at hall, x {{{step} * i + 1}} m, y {{i * {step} m}}\n"
        f"    for j in 0..{inner} {{ b_{{i+4}}_{{j}} is a bed at hall }}\n"
        "}\nlast is a door at hall\n"
    )
    rows = ["door is a door at hall\n"]
    for i in range(low, low + count + 1):
        rows.append(f"a_{i + 4} is a bed at hall, x {step * i + 1:.12f} m, y {i * step:.12f} m\n")
        rows += [f"b_{i + 4}_{j} is a bed at hall\n" for j in range(inner + 1)]
    rows.append("last is a door at hall\n")
    actual, expected = (
        [
            (one.name, round(one.place.x, 9) + 0.0, round(one.place.y, 9) + 0.0)
            for one in layer.instances
        ]
        for layer in (parse_scenery(text, "a.scenery"), parse_scenery("".join(rows), "a.scenery"))
    )
    assert actual == expected


@given(st.text("for i in1.2{}\n\"'/ x_+*", max_size=60))
def test_every_place_of_a_repeated_text_is_in_the_original(text):
    source = SourceText(f"a\n{text}for i in 1..3 {{ b_{{i}}\n }}\nend", "f")
    try:
        written = repeated(source)
    except Exception as error:
        assert type(error).__name__ == "InputError"
        return
    lines = source.text.split("\n")
    for offset in range(len(written.text) + 1):
        place = written.where(offset)
        assert 1 <= place.line <= len(lines)
        assert 1 <= place.column <= len(lines[place.line - 1]) + 1
    assert written.where(written.text.rindex("end")).line == len(lines)


def test_repeated_elements_vary_by_their_names(tmp_path):
    (tmp_path / "ward.fpm").write_text((WARD / "ward.fpm").read_text())
    text = (
        'import "ward.fpm"\nroom_3: { shape.length: uniform(6 m .. 7 m) }\n'
        "door_height: uniform([2 m])\nrequire room_width + room_3.shape.width < 8 m\n"
        "require doorway_1.location.translation.z <= 1 m\n"
    )
    variation = parse_variation(text, str(tmp_path / "w.variation"), tmp_path)
    (variant,) = sample(variation, 1, seed=7)
    plan = parse_floorplan(variant.text)
    lengths = [space.walls[1].length for space in plan.spaces if space.name in ("room_3", "room_4")]
    assert 6.0 <= lengths[0] <= 7.0
    assert lengths[1] == 5.0
    assert "for " not in variant.text
