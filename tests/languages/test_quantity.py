"""Quantities: numbers with units, and the expressions that stand for them in schemas."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.editor._schemas import QUANTITY_EXAMPLES, quantity_pattern
from grammars.text.quantity import read_as, read_quantity, unit_of
from grammars.text.units import DIMENSIONS, LENGTH, SPEED, TIME, from_si, read_unit, to_si
from tests.languages.plans import HERE, answers


def meaning(text):
    try:
        quantity = read_quantity(text)
    except ValueError as error:
        return str(error)
    assert quantity.unit == unit_of(quantity.dimension)
    return f"{quantity.value!r} {quantity.unit}, {quantity.dimension}"


def test_quantities_are_read_into_si_units_or_refused(golden):
    golden("tables/quantities.txt", answers("tables/quantities.txt", meaning))


def test_an_angle_is_neither_a_ratio_nor_a_length():
    with pytest.raises(ValueError, match='"3" has no unit, expected an angle such as "0.5 rad"'):
        read_as("3", "angle")
    with pytest.raises(ValueError, match='"3 rad" is in rad, expected a length'):
        read_as("3 rad", "length")


def test_a_bare_number_is_a_ratio_and_nothing_else():
    assert read_as(0.8, "ratio") == 0.8
    with pytest.raises(ValueError, match="3 has no unit"):
        read_as(3, "length")
    with pytest.raises(ValueError, match="expected a length"):
        read_as(True, "length")
    with pytest.raises(ValueError, match="ratio"):
        read_as(True, "ratio")


@given(st.floats(-1e6, 1e6), st.sampled_from(["m", "rad", "s", "kg", "m/s", "N m"]))
def test_si_values_read_back_as_written(value, unit):
    quantity = read_quantity(f"{value!r} {unit}")
    assert quantity.value == value
    assert quantity.unit == unit


def test_dimensions_have_the_units_their_quantities_are_read_in():
    for name, dimension in DIMENSIONS.items():
        assert dimension.unit == unit_of(name)
    assert (SPEED * TIME).unit == "m"
    assert (LENGTH * LENGTH / TIME).unit == "m^2/s"
    assert (TIME / LENGTH / SPEED).unit == "s^2/m^2"


FACTORS = [
    (line[:12].strip(), float(line[12:35]), line[35:].strip())
    for line in (HERE / "units.txt").read_text("utf-8").splitlines()[2:]
]


@pytest.mark.parametrize(("unit", "factor", "dimension"), FACTORS)
def test_units_have_their_factors_to_the_last_digit(unit, factor, dimension):
    assert read_quantity(f"1 {unit}").dimension == dimension
    assert read_unit(unit)[0] == factor
    for number in (1.0, 0.7, 12.5, 95.0):
        assert to_si(number, unit) == pytest.approx(number * factor, rel=1e-15)
        assert from_si(to_si(number, unit), unit) == pytest.approx(number, rel=1e-15)


UNITS = [(dimension, unit) for unit, _, dimension in FACTORS if dimension in QUANTITY_EXAMPLES]
UNITS += [("speed", "cm / s"), ("speed", "metres/second"), ("torque", "kg m^2/s^2")]
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
