"""YAML 1.2 as ruamel.yaml reads it, whichever of the two readers hands over the events."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from grammars.text import yaml_composer
from grammars.text.diagnostics import InputError
from grammars.text.documents import parse_yaml

ROOT = Path(__file__).parents[3]
FILES = sorted([*ROOT.glob("campaigns/**/*.yaml"), *ROOT.glob("tests/published_robots/**/*.yaml")])


def plain(value):
    """Return what ruamel.yaml reads as plain data; dates are the text they are written as."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    for kind in (bool, int, float, str):
        if isinstance(value, kind):
            return "nan" if kind is float and math.isnan(value) else kind(value)
    return value if value is None else str(value)


def reference(text):
    yaml = YAML(typ="rt")
    yaml.version = (1, 2)
    return plain(yaml.load(text))


def places_of(tree, path=()):
    """Return line and column, from 0, of every key and item of a tree of ruamel.yaml."""
    found = {}
    if isinstance(tree, dict):
        for key, value in tree.items():
            place = tree  # its marks are no part of a dict's type
            found[(*path, key)] = tuple(place.lc.key(key))
            found |= places_of(value, (*path, key))
    elif isinstance(tree, list):
        for index, value in enumerate(tree):
            marked = tree
            found[(*path, index)] = tuple(marked.lc.item(index))
            found |= places_of(value, (*path, index))
    return found


@pytest.mark.parametrize("reader", ["libyaml", "ruamel"])
def test_files_have_the_values_and_places_of_ruamel_yaml(reader, monkeypatch):
    if reader == "ruamel":
        monkeypatch.setattr(yaml_composer, "_fast_loader", lambda: None)
    for file in FILES[:12]:
        text = file.read_text("utf-8")
        yaml = YAML(typ="rt")
        yaml.version = (1, 2)
        tree = yaml.load(text)
        document = parse_yaml(text, str(file))
        assert document.data == plain(tree)
        given = {path: (w.line - 1, w.column - 1) for path, w in document.places.items() if path}
        assert given == places_of(tree)


@given(st.text(alphabet="0123456789abfxoeEnul~tr+-._TFRUSI", max_size=9))
def test_a_plain_scalar_means_what_it_means_to_ruamel_yaml(text):
    try:
        expected = reference(f"a: {text}\n")
        expected = expected["a"]
    except (YAMLError, ValueError, IndexError, TypeError, AttributeError, KeyError):
        return
    if isinstance(expected, int | float) and not math.isinf(expected) and abs(expected) >= 2**64:
        return
    try:
        assert plain(parse_yaml(f"a: {text}\n", "x.yaml").data["a"]) == expected
    except InputError:
        assert isinstance(expected, int)


@given(st.text(alphabet=st.sampled_from("ab:-[]{},'\"\n  #&|>@%01.~?=e"), max_size=30))
def test_both_readers_agree(text):
    def outcome():
        try:
            document = parse_yaml(text, "x.yaml")
        except InputError:
            return None, "refused"
        return plain(document.data), document.places

    fast = outcome()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml_composer, "_fast_loader", lambda: None)
        assert outcome() == fast


def test_a_long_file_is_read_or_refused_with_the_reason(monkeypatch):
    long = "".join(f"key_{i}: {i}.5 m\n" for i in range(40_000))
    assert len(parse_yaml(long, "x.yaml").data) == 40_000
    with pytest.raises(InputError, match=r"x\.yaml:40001:4: is not valid YAML"):
        parse_yaml(long + "a: @\n", "x.yaml")
    monkeypatch.setattr(yaml_composer, "_MOST_NODES", 1000)
    with pytest.raises(InputError, match=r"x\.yaml:500:10: holds more than 1000 keys and values"):
        parse_yaml(long, "x.yaml")


def test_what_steers_a_terminal_is_spelt_out():
    with pytest.raises(InputError) as caught:
        parse_yaml('"\\e[31mred": 1\n"\\e[31mred": 2\n? [1]\n', "x.yaml")
    assert "\x1b" not in str(caught.value)
