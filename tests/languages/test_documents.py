"""YAML documents with places, read into models; findings about them."""

from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from grammars.text.diagnostics import InputError
from grammars.text.documents import (
    OtherName,
    StrictModel,
    load_yaml,
    parse_yaml,
    read_model,
)
from grammars.text.quantity import Length
from tests.languages.plans import answers


class Room(StrictModel):
    name: str
    width: Length
    doors: list[dict[str, Length]] = []


class House(StrictModel):
    rooms: dict[str, Room] = Field(min_length=1)
    owner: Room | None = None


class Named(StrictModel):
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,9}$")
    ids: dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")], int] = {}
    mood: Literal["calm", "rude"] = "calm"
    some: list[int] = Field(default=[1], min_length=1)


class Corridor(StrictModel):
    elsewhere = {"wide": OtherName("width"), "door": "it is called for in the plan: move it there"}


MODELS = {"rooms": House, "name": Named, "wide": Corridor, "door": Corridor}


def meaning(text):
    """Return the model of a text, or all findings, in one line."""
    for escape, sign in (("\\n", "\n"), ("\\t", "\t"), ("\\0", "\0")):
        text = text.replace(escape, sign)
    try:
        return repr(read_model(parse_yaml(text, "h.yaml"), MODELS[text.partition(":")[0]]))
    except InputError as error:
        return " | ".join(map(str, error.findings)).replace("\n   ", ",")


def test_texts_become_models_or_are_refused_with_every_finding(golden):
    golden("tables/documents.txt", answers("tables/documents.txt", meaning))


def problems(text):
    with pytest.raises(InputError) as caught:
        read_model(parse_yaml(text, "house.yaml"), House)
    return [str(d) for d in caught.value.findings]


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
