"""Whatever is written, a person gets diagnostics and never a raw exception."""

import re

from hypothesis import given
from hypothesis import strategies as st

from grammars.scenery import configure, parse_scenery
from grammars.text.diagnostics import InputError
from tests.languages.scenery.samples import PEOPLE_AND_ALL as EVERYTHING

TOKENS = re.findall(r"\w+|[^\w\s]", EVERYTHING)

LAYER = parse_scenery(EVERYTHING, "fuzz.scenery")


def read(text):
    try:
        layer = parse_scenery(text, "fuzz.scenery")
    except InputError as error:
        assert error.findings
        assert all(d.message and d.where.file == "fuzz.scenery" for d in error.findings)
    else:
        assert layer.name == "fuzz"


@given(st.text(max_size=200))
def test_any_text(text):
    read(text)


@given(st.lists(st.sampled_from(TOKENS), max_size=40))
def test_any_sequence_of_known_words(words):
    read(" ".join(words))


@given(st.integers(0, len(EVERYTHING) - 1), st.integers(0, 12), st.text(max_size=3))
def test_a_small_change_somewhere(position, length, replacement):
    read(EVERYTHING[:position] + replacement + EVERYTHING[position + length :])


@given(st.integers(0, len(TOKENS) - 1), st.sampled_from([*TOKENS, "1e999 m", "-5 m", "0 rad"]))
def test_one_word_replaced_by_another(index, word):
    read(" ".join([*TOKENS[:index], word, *TOKENS[index + 1 :]]))


@given(
    st.dictionaries(
        st.sampled_from(["main_doors", "near", "swing", "other"]),
        st.recursive(
            st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
            lambda inner: st.lists(inner, max_size=3),
        ),
    )
)
def test_any_override(overrides):
    try:
        configure(LAYER, overrides)
    except InputError as error:
        assert error.findings
