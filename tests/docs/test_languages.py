"""The reference of the languages: examples are tried, tables are made, nothing is left out."""

import functools

import pytest

from tests.docs import ebnf, examples, regions, tables
from tests.docs.markdown import LANGUAGES

PAGES = sorted(LANGUAGES.glob("*.md"))
_WITHOUT_EXAMPLE = {"scenery Reserved", "oracle Custom", "floorplan Operator"}
"""Rules that no example can use: words that are no names, oracles that plug in, signs ahead."""


@functools.cache
def _exercised():
    return frozenset().union(*(examples.exercised(examples.examples(page)) for page in PAGES))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_examples_are_right_and_errors_say_what_is_shown(page, tmp_path):
    folder = examples.make_folder(tmp_path)
    problems = [examples.try_example(folder, example) for example in examples.examples(page)]
    wrong = [problem for problem in problems if problem]
    assert wrong == [], "new words of a message: python -m tests.docs --messages"


def test_made_parts_are_current():
    old = [page.name for page, text in regions.made_pages() if page.read_text("utf-8") != text]
    assert old == [], "write them anew: python -m tests.docs"


@pytest.mark.parametrize("language", sorted(ebnf.GRAMMARS))
def test_every_rule_of_a_grammar_is_shown_and_used_by_an_example(language):
    rules = {f"{language} {name}" for name in ebnf.rules(language)}
    assert rules - regions.shown("grammar") == set()
    words = {f"{language} {word}" for word in ebnf.words(language)}
    assert (rules | words) - _WITHOUT_EXAMPLE - _exercised() == set()


@pytest.mark.parametrize("name", ["campaign", "mission", "robot", "sut", "walls"])
def test_every_key_of_a_schema_is_in_a_table(name):
    parts = {key.partition(".")[0] for key in tables.keys_of(name)}
    parts -= {part for part in parts if part.startswith("ros2")}  # a hand-written table
    parts -= {"defaults"}  # keys of a scenario
    assert {f"{name} {part}" for part in parts} - regions.shown("keys") == set()


@pytest.mark.parametrize("name", ["campaign", "mission", "robot", "sut", "walls"])
def test_every_key_of_a_schema_is_in_an_example(name):
    keys = tables.keys_of(name)
    if name == "sut":  # The parameters of ROS 1 are a table alone, there are hundreds.
        keys = frozenset(key for key in keys if key.startswith("sut."))
    assert {f"{name} {key}" for key in keys} - _exercised() == set()
