"""YAML documents with places, read into models; findings about them."""

from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from grammars.text.diagnostics import Findings, InputError, Where
from grammars.text.documents import (
    OtherName,
    StrictModel,
    load_yaml,
    parse_yaml,
    read_model,
)
from grammars.text.quantity import Length


class Room(StrictModel):
    name: str
    width: Length
    doors: list[dict[str, Length]] = []


class House(StrictModel):
    rooms: dict[str, Room] = Field(min_length=1)
    owner: Room | None = None


def problems(text):
    with pytest.raises(InputError) as caught:
        read_model(parse_yaml(text, "house.yaml"), House)
    return [str(d) for d in caught.value.findings]


def test_a_good_file_becomes_a_model():
    house = read_model(parse_yaml("rooms:\n  a: {name: kitchen, width: 300 cm}\n", "h.yaml"), House)
    assert house.rooms["a"].width == pytest.approx(3.0)


def test_all_findings_come_at_once_each_with_its_place():
    messages = problems("rooms:\n  a:\n    name: [1]\n    widht: 3 m\n")
    assert [f.splitlines()[0] for f in messages] == [
        "house.yaml:3:5: name: must be text",
        'house.yaml:2:3: key "width" is missing',
        'house.yaml:4:5: unknown key "widht"',
    ]
    assert 'did you mean "width"?' in messages[2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a:\n\tb: 1\n", "indent with spaces"),
        ("a: " + 5000 * "[", "h.yaml:1:53: is nested deeper than 50 levels"),
        ("a: x\nb: \x00", "h.yaml:2:4: is not valid YAML: holds the control character U+0000"),
        ("a: " + 5000 * "9", "h.yaml:1:4: is a number too large"),
        ("a:\n  - 0x" + 5000 * "f", "h.yaml:2:5: is a number too large"),
    ],
)
def test_yaml_that_no_file_of_ours_holds_is_refused_at_its_place(text, message):
    with pytest.raises(InputError) as caught:
        parse_yaml(text, "h.yaml")
    assert message in str(caught.value)


def test_files_that_cannot_be_read_are_refused_with_their_neighbours(tmp_path):
    (tmp_path / "campaign.yaml").write_text("a: 1")
    with pytest.raises(InputError, match='did you mean "campaign.yaml"'):
        load_yaml(tmp_path / "campain.yaml")
    with pytest.raises(
        InputError, match=r'is a folder, expected a file\n.*did you mean ".*campaign\.yaml"'
    ):
        load_yaml(tmp_path)
    (tmp_path / "x.yaml").write_bytes(b"a: \xff\xfe")
    with pytest.raises(InputError, match="not UTF-8"):
        load_yaml(tmp_path / "x.yaml")


class Named(StrictModel):
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,9}$")
    ids: dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")], int] = {}
    mood: Literal["calm", "rude"] = "calm"
    some: list[int] = Field(default=[1], min_length=1)


def test_findings_are_told_in_the_words_of_the_file():
    text = "name: ü\nids: {a b: 1, c: 1.5}\nmood: sad\nsome: []\n"
    with pytest.raises(InputError) as caught:
        read_model(parse_yaml(text, "h.yaml"), Named)
    assert [str(d) for d in caught.value.findings] == [
        'h.yaml:1:1: name: must be letters (a to z), digits, ".", "_" and "-", 10 at most, '
        "and begin with a letter or digit",
        'h.yaml:2:7: a b: must be letters (a to z), digits, "_" and "-", '
        "and begin with a letter or digit",
        "h.yaml:2:15: c: must be a whole number",
        "h.yaml:3:1: mood: must be 'calm' or 'rude'",
        "h.yaml:4:1: some: must have 1 or more",
    ]


class Corridor(StrictModel):
    elsewhere = {"wide": OtherName("width"), "door": "it is called for in the plan: move it there"}


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("wide", 'unknown key "wide"\n    it is called width'),
        ("door", 'key "door" is in the wrong place\n    it is called for in the plan'),
    ],
)
def test_a_key_of_another_name_is_told_from_one_of_another_place(key, said):
    with pytest.raises(InputError) as caught:
        read_model(parse_yaml(f"{key}: 1\n", "corridor.yaml"), Corridor)
    assert said in str(caught.value)


LINE_ENDS_TO_YAML_ALONE = "\u2028\u2029\x85"


@pytest.mark.parametrize("sign", LINE_ENDS_TO_YAML_ALONE)
def test_lines_are_those_that_an_editor_counts(sign):
    text = f"rooms:\n  a: {{name: 'x{sign}y', widht: 1 m}}\n"
    assert [problem.splitlines()[0] for problem in problems(text)] == [
        'house.yaml:2:3: key "width" is missing',
        'house.yaml:2:20: unknown key "widht"',
    ]
    assert problems(f"owner: 'x{sign}y'\nrooms: {{a: {{name: 3.10, width: 1 m}}}}\n")[0] == (
        'house.yaml:2:13: name: must be text\n    3.10 is a number: write it as "3.10"'
    )


@given(st.text(alphabet=f"ab:-[]{{}}'#\n {LINE_ENDS_TO_YAML_ALONE}", max_size=30))
def test_every_place_is_one_that_the_file_has(text):
    lines = text.split("\n")
    try:
        places = list(parse_yaml(text, "x.yaml").places.values())
    except InputError as error:
        places = [problem.where for problem in error.findings]
    assert all(place.column <= len(lines[place.line - 1]) + 1 for place in places)


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("d: d", "x.yaml:1:4"),
        ('{a: 1, "d": "d"}', "x.yaml:1:14"),
        ('d: "\\x64"', "x.yaml:1"),
        ("d:\n  d", "x.yaml:1"),
    ],
)
def test_a_text_begins_behind_its_key_unless_it_is_laid_out_otherwise(line, place):
    assert str(parse_yaml(line, "x.yaml").where_text("d")) == place


FILE = "a.scenery"


def findings_of(*places):
    findings = Findings()
    for file, line in places:
        findings.error(Where(file, line), "wrong")
    return findings


def test_all_errors_and_warnings_are_raised_once_in_source_order():
    findings = findings_of((FILE, 7), (FILE, 1), (FILE, 1))
    findings.warning(Where(FILE, 3), "odd")
    with pytest.raises(InputError) as caught:
        findings.raise_errors()
    assert [(d.where.line, d.message) for d in caught.value.findings] == [
        (1, "wrong"),
        (3, "odd"),
        (7, "wrong"),
    ]


def test_warnings_alone_raise_nothing():
    findings = Findings()
    findings.warning(Where(FILE, 3), "odd")
    findings.raise_errors()
    assert [d.message for d in findings.warnings] == ["odd"]
    assert findings.errors == ()


def test_an_input_error_ends_its_block_and_is_collected():
    findings = Findings()
    for line in (2, 1):
        with findings.collecting():
            raise InputError.at(Where(FILE, line), f"wrong in line {line}")
    assert [d.where.line for d in findings.errors] == [1, 2]


def test_files_keep_the_order_in_which_they_appear():
    places = [("b", 5), ("a", 1), ("b", 2)]
    errors = [(d.where.file, d.where.line) for d in findings_of(*places).errors]
    assert errors == [("b", 2), ("b", 5), ("a", 1)]
