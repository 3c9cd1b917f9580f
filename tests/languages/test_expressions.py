"""Expressions of named values: how they are read, worked out and written again."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.text import expressions
from grammars.text.diagnostics import InputError, SourceText, Where
from grammars.text.expression_check import read_predicate
from grammars.text.expressions import (
    Arithmetic,
    Comparison,
    ExpressionLanguage,
    Function,
    Logic,
    Name,
    Not,
    evaluate,
    read_expression,
    render,
    walk,
)
from grammars.text.units import to_si
from tests.languages.plans import answers

UNITS = {
    "doors.closes": "s",
    "doors.opens": "min",
    "doors.opens.late": "s",
    "a planner.speed": "m/s",
    "swing": "deg",
    "turn": "rad",
    "count": "",
    "zero": "",
}
HERE = Where("campaign.yaml", 9, 17)


def read(text, units=UNITS):
    return read_predicate(text, units, HERE)


def holds(text, units=UNITS, **values):
    actual = evaluate(read(text, units), lambda n: to_si(values[n.name], units[n.name]))
    return None if math.isnan(actual) else bool(actual)


VALUES = {"doors.closes": 59.0, "doors.opens": 1.0, "doors.opens.late": 8.0, "swing": 90.0}
VALUES |= {"turn": 1.57, "count": 2.0, "zero": 0.0}


def meaning(text):
    """Return whether a predicate holds; it is unknown after a division by zero."""
    try:
        return {True: "holds", False: "fails", None: "unknown"}[holds(text, **VALUES)]
    except InputError as error:
        return " | ".join(finding.message for finding in error.findings)


def test_values_are_compared_in_si_units(golden):
    golden("tables/predicates.txt", answers("tables/predicates.txt", meaning))


def test_what_is_equal_up_to_rounding_is_equal():
    units = {"a": "s", "b": "s"}
    assert holds("a + b <= 0.3 s and a + b == 0.3 s", units, a=0.1, b=0.2)
    assert not holds("a + b > 0.3 s", units, a=0.1, b=0.2)
    assert not holds("a + b != 3e8 s", units, a=1e8, b=2e8 + 1e-6)


def test_a_name_with_slashes_is_known_in_quotes_alone():
    units = {"sut.planner/speed": "m/s"}
    assert holds('"sut.planner/speed" < 0.5 m/s', units, **{"sut.planner/speed": 0.4})
    with pytest.raises(InputError, match='write it in quotes: "sut.planner/speed"'):
        read("sut.planner/speed < 0.5 m/s", units)


def test_a_predicate_has_a_thousand_characters_at_most():
    with pytest.raises(InputError, match="is longer than 1000 characters"):
        read(" + ".join(["count"] * 200) + " < 1")


def test_a_sum_of_a_thousand_terms_is_one_more_expression():
    source = SourceText(" + ".join(["count"] * 1500) + " < 1", "")
    grammar = Path(expressions.__file__).with_name("expressions.tx")
    language = ExpressionLanguage(grammar, autokwd=True)
    predicate = read_expression(language.parse(source), source)
    assert isinstance(predicate, Comparison)
    assert len(walk(predicate)) == 1500 + 1499 + 2
    assert evaluate(predicate.left, lambda name: 2.0) == 3000.0
    assert render(predicate.left).startswith("((((")


NAMES = st.sampled_from(["a", "b.c", "door-17", "two words"]).map(Name)
QUANTITIES = st.recursive(
    NAMES,
    lambda inner: st.one_of(
        st.builds(Arithmetic, st.sampled_from("+-*/"), inner, inner),
        inner.map(lambda operand: Function("-", (operand,))),
        st.builds(Function, st.sampled_from(["min", "max"]), st.tuples(inner, inner)),
    ),
    max_leaves=6,
)


PREDICATES = st.recursive(
    st.builds(Comparison, st.sampled_from(["<", ">="]), QUANTITIES, QUANTITIES),
    lambda inner: (
        st.builds(Not, inner)
        | st.builds(Logic, st.sampled_from(["and", "or"]), st.tuples(inner, inner))
    ),
    max_leaves=4,
)


@given(PREDICATES)
def test_what_is_written_again_means_the_same(predicate):
    units = dict.fromkeys(["a", "b.c", "door-17", "two words"], "")
    assert read(render(predicate), units) == predicate
