"""Values written as YAML and read back."""

import json

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from grammars.text.documents import parse_yaml
from grammars.text.yaml_text import comment_text, yaml_text

TEXT = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=12)
WORDS = st.sampled_from(
    [
        "yes",
        "null",
        "1.5",
        "1e3",
        "0x1f",
        "60 deg/s",
        "-0.2 m",
        "a b",
        "~",
        "../a.fpm",
        "S3.1",
        ".5",
    ]
)
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
