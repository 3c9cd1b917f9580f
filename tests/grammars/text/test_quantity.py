import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.text.diagnostics import InputError, Where
from grammars.text.quantity import (
    DIMENSIONS,
    LENGTH,
    PLAN_UNITS,
    SPEED,
    TIME,
    calculate_unit,
    parse_quantity,
    read_as,
    read_quantity,
    unit_of,
)
from grammars.text.unit_table import SI_UNITS, UNITS


@pytest.mark.parametrize(
    ("text", "value", "dimension"),
    [
        ("0.35 m", 0.35, "length"),
        ("30 cm", 0.3, "length"),
        ("5mm", 0.005, "length"),
        ("20 min", 1200.0, "time"),
        ("90 deg", math.pi / 2, "angle"),
        ("-90°", -math.pi / 2, "angle"),
        ("95 %", 0.95, "ratio"),
        ("7 cm", 0.07, "length"),
        ("3", 3.0, "ratio"),
        ("0.25 m/s", 0.25, "speed"),
        ("90 deg/s", math.pi / 2, "angular speed"),
        ("1 m/s^2", 1.0, "acceleration"),
        ("0.5 N m", 0.5, "torque"),
        ("0.5 N m/rad", 0.5, "torsional stiffness"),
        ("10 Hz", 10.0, "frequency"),
        ("1e2 kg", 100.0, "mass"),
        ("0.01 m/m^0.5", 0.01, "noise per root length"),
    ],
)
def test_quantities_are_read_into_si_units(text, value, dimension):
    quantity = read_quantity(text)
    assert quantity.value == pytest.approx(value)
    assert quantity.dimension == dimension
    assert quantity.unit == unit_of(dimension)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "m",
        "1.2.3 m",
        "1 parsec",
        "3 m s",
        "1 m^9^9^9",
        "1e999 m",
        "nan m",
        "import os",
        "1 m; 2 m",
    ],
)
def test_anything_else_is_refused_with_words(text):
    with pytest.raises(ValueError, match=r"\w+"):
        read_quantity(text)


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


def test_a_refused_quantity_names_its_place():
    with pytest.raises(InputError, match=r"doors\.scenery:3:7: .*not a unit"):
        parse_quantity("3 furlong", Where("doors.scenery", 3, 7))


@given(st.text(max_size=30))
def test_no_text_makes_the_reader_raise_anything_but_value_errors(text):
    try:
        quantity = read_quantity(text)
    except ValueError:
        return
    assert math.isfinite(quantity.value)


@given(st.floats(-1e6, 1e6), st.sampled_from(["m", "rad", "s", "kg", "m/s", "N m"]))
def test_si_values_read_back_as_written(value, unit):
    quantity = read_quantity(f"{value!r} {unit}")
    assert quantity.value == value
    assert quantity.unit == unit


@pytest.mark.parametrize(("text", "value"), [("95 %", 0.95), ("7 cm", 0.07), ("3 mm", 0.003)])
def test_decimal_units_read_as_the_number_one_would_write(text, value):
    assert read_quantity(text).value == value


def test_dimensions_have_the_units_their_quantities_are_read_in():
    for name, dimension in DIMENSIONS.items():
        assert dimension.unit == unit_of(name)
    assert (SPEED * TIME).unit == "m"
    assert (LENGTH * LENGTH / TIME).unit == "m^2/s"
    assert (TIME / LENGTH / SPEED).unit == "s^2/m^2"


@pytest.mark.parametrize("unit", PLAN_UNITS)
def test_units_of_plans_are_those_of_every_other_file(unit):
    quantity = read_quantity(f"1 {unit}")
    assert PLAN_UNITS[unit] == (quantity.value, quantity.dimension)


@pytest.mark.parametrize("unit", UNITS)
def test_the_table_of_units_says_what_pint_calculates(unit):
    assert UNITS[unit] == calculate_unit(unit)


def test_the_table_of_units_has_every_si_unit():
    assert {UNITS[unit] for unit in SI_UNITS.values()} == {(1.0, name) for name in SI_UNITS}


def test_units_that_no_table_has_are_calculated():
    assert read_quantity("2 cm/min").value == pytest.approx(0.02 / 60)
    assert read_quantity("2 kHz").dimension == "frequency"
