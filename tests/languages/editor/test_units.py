"""The expressions that stand for quantities in schemas agree with the reader of quantities."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.editor import QUANTITY_EXAMPLES, quantity_pattern
from grammars.text.quantity import read_as

SIMPLE = {
    "length": ["m", "cm", "mm", "km", "metre", "metres", "meters", "centimetre"],
    "angle": ["rad", "deg", "°", "radians", "degrees", "mrad"],
    "time": ["s", "ms", "min", "h", "seconds", "minutes", "hours"],
    "mass": ["kg", "g", "kilograms"],
    "frequency": ["Hz", "kHz", "hertz"],
    "force": ["N", "kN", "newtons"],
}
COMPOUND = {
    "speed": ["m/s", "km/h", "cm / s", "metres/second"],
    "angular speed": ["rad/s", "deg/s", "°/s", "deg/min"],
    "acceleration": ["m/s^2", "m/s/s", "cm/s^2"],
    "angular acceleration": ["rad/s^2", "deg/s^2"],
    "torque": ["N m", "N*m", "kN m", "m N", "kg m^2/s^2"],
    "stiffness": ["N/m", "kN/m"],
    "noise per root length": ["m/m^0.5", "cm/m^0.5"],
    "noise per root angle": ["rad/rad^0.5"],
    "drift per root length": ["rad/m^0.5", "deg/m^.5"],
}
UNITS = [(d, u) for table in (SIMPLE, COMPOUND) for d, units in table.items() for u in units]
NUMBERS = st.one_of(
    st.floats(0, 1e6, allow_subnormal=False).map(lambda v: f"{v:.4g}"),
    st.sampled_from(["0", "1.", ".5", "2e3", "1E-3", "+4", "-7.5"]),
)


def reads(text, dimension):
    try:
        read_as(text, dimension)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("dimension", sorted(QUANTITY_EXAMPLES))
def test_examples_are_read_and_match(dimension):
    assert reads(QUANTITY_EXAMPLES[dimension], dimension)
    assert re.search(quantity_pattern(dimension), QUANTITY_EXAMPLES[dimension])


@given(NUMBERS, st.sampled_from(UNITS))
def test_what_the_reader_takes_matches(number, unit):
    text = f"{number} {unit[1]}"
    assert reads(text, unit[0])
    assert re.search(quantity_pattern(unit[0]), text)


@given(NUMBERS, st.sampled_from(UNITS), st.sampled_from(sorted(QUANTITY_EXAMPLES)))
def test_what_matches_with_one_or_two_units_is_read(number, unit, dimension):
    text = f"{number} {unit[1]}"
    factors = len(re.split(r"[\s*/]+", unit[1]))
    if factors < 3 and re.search(quantity_pattern(dimension), text):
        assert reads(text, dimension)


@pytest.mark.parametrize("text", ["3", "", "m", "3 m m", "3 s", "three m", "3 m/s", "3, m"])
def test_what_is_no_length_does_not_match(text):
    assert not re.search(quantity_pattern("length"), text)


def test_signs_and_zeros_are_refused_where_they_mean_nothing():
    positive = quantity_pattern("length", signed=False, nonzero=True)
    assert re.search(positive, "0.05 m")
    assert re.search(positive, "1e-3 m")
    for text in ("-1 m", "0 m", "0.000 m", "0e5 m"):
        assert not re.search(positive, text)
    assert re.search(quantity_pattern("length", signed=False), "0 m")


def test_a_ratio_is_a_percentage_or_nothing_but_a_number():
    for text in ("5 %", "5%", "0.05", "95 percent"):
        assert reads(text, "ratio")
        assert re.search(quantity_pattern("ratio"), text)
    assert not re.search(quantity_pattern("ratio"), "5 m")
