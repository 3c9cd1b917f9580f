"""YAML 1.2 and its values, whichever parser of PyYAML hands over the events, and written again."""

import json
import math
import re

import pytest
import yaml
from hypothesis import assume, example, given
from hypothesis import strategies as st

from grammars.text import yaml_composer
from grammars.text.diagnostics import InputError, Where
from grammars.text.documents import parse_yaml
from grammars.text.yaml_text import comment_text, yaml_text
from tests.parts import ROOT


def outcome(text):
    """Return data and places, or that there are none; nan is told from text."""
    try:
        document = parse_yaml(text, "x.yaml")
    except InputError:
        return None, "refused"
    return repr(document.data), document.places


def with_own_parser(text):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml_composer, "yaml_loader", lambda: yaml.SafeLoader)
        return outcome(text)


def test_libyaml_is_what_reads_here():
    assert yaml_composer.yaml_loader() is yaml.CSafeLoader


@pytest.mark.parametrize(
    "file", sorted(ROOT.glob("campaigns/**/*.yaml")), ids=lambda file: file.name
)
def test_both_parsers_give_one_document(file):
    text = file.read_text("utf-8")
    data, places = outcome(text)
    assert data is not None
    assert len(places) > 3
    assert with_own_parser(text) == (data, places)


@given(st.text(alphabet=st.sampled_from("ab:-[]{},'\"\n  #&|>@%01.~?=e"), max_size=30))
def test_both_parsers_agree(text):
    # After the sign of a block, libyaml takes "#" for a comment; its twin wants a blank before it.
    assume(not re.search(r"[|>][-+0-9]*#", text))
    assert outcome(text) == with_own_parser(text)


@pytest.mark.parametrize("text", ["a: {b: 1", "a: 1\nb: [", "a: 'x", "a: {b: 1\n"])
def test_a_text_that_ends_too_early_is_refused_where_it_ends(text):
    with pytest.raises(InputError) as caught:
        parse_yaml(text, "x.yaml")
    (problem,) = caught.value.findings
    last = text.split("\n")[-1]
    assert problem.where == Where("x.yaml", text.count("\n") + 1, len(last) + 1)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a:\u00a01\n", "1:3: holds a no-break space"),
        ("a:\n\u00a0 b: 1\n", "2:1: holds a no-break space"),
        ("a: 1\n<<<<<<< HEAD\nb: 2\n", "2:8: holds the mark of a merge conflict"),
        ("a:\n  b: 1\n c: 2\n", "3:2: is not valid YAML: this line is indented"),
        ('a: "x\nb: 3\n', "3:1: is not valid YAML: ends in quotes\n    they open in line 1"),
    ],
)
def test_slips_of_editors_are_named(text, problem):
    assert parse_yaml("a: 1\u00a0m\n", "x.yaml").data == {"a": "1\u00a0m"}
    with pytest.raises(InputError, match=problem):
        parse_yaml(text, "x.yaml")


SPECIFIED = (
    (r"null|Null|NULL|~|", lambda text: None),
    (r"true|True|TRUE", lambda text: True),
    (r"false|False|FALSE", lambda text: False),
    (r"[-+]?[0-9]+", int),
    (r"0o[0-7]+", lambda text: int(text[2:], 8)),
    (r"0x[0-9a-fA-F]+", lambda text: int(text, 16)),
    (r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", float),
    (r"[-+]?\.(?:inf|Inf|INF)", lambda text: float(text.replace(".", ""))),
    (r"\.(?:nan|NaN|NAN)", lambda text: math.nan),
)
"""Tag resolution of the core schema: YAML 1.2.2, section 10.3.2."""


def specified(text):
    return next((mean(text) for form, mean in SPECIFIED if re.fullmatch(form, text)), text)


OURS = re.compile(r"[-+]0[xo].*|[-+]?0b[01]+")
"""Numbers beyond the core schema: with a sign before the base, and binary ones."""


@given(st.text(alphabet="0123456789abfxoeEnul~tr+-._TFRUSI".replace("_", ""), max_size=9))
def test_a_plain_scalar_means_what_the_core_schema_says(text):
    if not OURS.fullmatch(text):
        assert repr(yaml_composer.read_plain(text)) == repr(specified(text))


@pytest.mark.parametrize(
    ("text", "value"),
    [("1_000", 1000), ("0b101", 5), ("-0x1f", -31), ("1_0.5", 10.5), ("_1", "_1")],
)
def test_numbers_beyond_the_core_schema(text, value):
    assert parse_yaml(f"a: {text}\n", "x.yaml").data == {"a": value}


def test_a_long_file_is_read_to_its_end_or_refused_with_the_reason(monkeypatch):
    long = "".join(f"key_{i}: {i}.5 m\n" for i in range(40_000))
    with pytest.raises(InputError, match=r"x\.yaml:40001:4: is not valid YAML"):
        parse_yaml(long + "a: @\n", "x.yaml")
    monkeypatch.setattr(yaml_composer, "_MOST_NODES", 1000)
    with pytest.raises(InputError, match=r"x\.yaml:500:10: holds more than 1000 keys and values"):
        parse_yaml(long, "x.yaml")


TEXT = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=12)
WORDS = "yes|null|1.5|1e3|0x1f|60 deg/s|-0.2 m|a b|~|../a.fpm|S3.1|.5"
WORDS = st.sampled_from(WORDS.split("|"))
SCALARS = st.none() | st.booleans() | st.integers(-(10**9), 10**9) | TEXT | WORDS
FLOATS = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e9, max_value=1e9)
KEYS = (TEXT | WORDS).filter(bool)
VALUES = st.recursive(
    SCALARS | FLOATS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize("plain", [True, False])
@example(tree={"0": 5e-324, "a": [{"b": -1e-7}]})
@given(tree=st.dictionaries(KEYS, VALUES, min_size=1, max_size=4))
def test_what_is_written_is_read_back(plain, tree):
    text = yaml_text(tree, plain=plain)
    assert parse_yaml(text, "a.yaml").data == tree
    assert json.loads(json.dumps(yaml.safe_load(text))) == tree


def test_quotes_are_left_out_where_they_are_not_needed():
    tree = {"limit": "45.5 s", "behaviours": [{"doors": {"swing": "50 deg/s"}}], "a b": ["no", "x"]}
    assert yaml_text(tree, plain=True) == (
        'limit: 45.5 s\nbehaviours:\n  - {doors: {swing: 50 deg/s}}\na b: ["no", x]\n'
    )


def test_a_comment_has_a_sign_before_each_line():
    assert comment_text("one\n\ntwo") == "# one\n#\n# two\n"
    assert comment_text("") == ""
