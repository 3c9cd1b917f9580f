import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.text.diagnostics import InputError, Where
from grammars.text.quantity import (
    parse_quantity,
    read_as,
    read_quantity,
    unit_of,
)
from grammars.text.units import DIMENSIONS, LENGTH, SPEED, TIME, from_si, read_unit, to_si


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


FACTORS = {
    "%": (0.01, "ratio"),
    "pct": (0.01, "ratio"),
    "percent": (0.01, "ratio"),
    "m": (1.0, "length"),
    "metre": (1.0, "length"),
    "metres": (1.0, "length"),
    "meter": (1.0, "length"),
    "meters": (1.0, "length"),
    "mm": (0.001, "length"),
    "cm": (0.01, "length"),
    "km": (1000.0, "length"),
    "millimetre": (0.001, "length"),
    "centimetre": (0.01, "length"),
    "kilometre": (1000.0, "length"),
    "rad": (1.0, "angle"),
    "radian": (1.0, "angle"),
    "radians": (1.0, "angle"),
    "deg": (0.017453292519943295, "angle"),
    "degree": (0.017453292519943295, "angle"),
    "degrees": (0.017453292519943295, "angle"),
    "°": (0.017453292519943295, "angle"),
    "mrad": (0.001, "angle"),
    "s": (1.0, "time"),
    "second": (1.0, "time"),
    "seconds": (1.0, "time"),
    "ms": (0.001, "time"),
    "millisecond": (0.001, "time"),
    "milliseconds": (0.001, "time"),
    "min": (60.0, "time"),
    "minute": (60.0, "time"),
    "minutes": (60.0, "time"),
    "h": (3600.0, "time"),
    "hour": (3600.0, "time"),
    "hours": (3600.0, "time"),
    "g": (0.001, "mass"),
    "gram": (0.001, "mass"),
    "kg": (1.0, "mass"),
    "kilogram": (1.0, "mass"),
    "Hz": (1.0, "frequency"),
    "hertz": (1.0, "frequency"),
    "kHz": (1000.0, "frequency"),
    "m/s": (1.0, "speed"),
    "cm/s": (0.01, "speed"),
    "mm/s": (0.001, "speed"),
    "km/h": (0.2777777777777778, "speed"),
    "m/min": (0.016666666666666666, "speed"),
    "rad/s": (1.0, "angular speed"),
    "deg/s": (0.017453292519943295, "angular speed"),
    "°/s": (0.017453292519943295, "angular speed"),
    "degree/s": (0.017453292519943295, "angular speed"),
    "degrees/s": (0.017453292519943295, "angular speed"),
    "m/s^2": (1.0, "acceleration"),
    "m/s/s": (1.0, "acceleration"),
    "cm/s^2": (0.01, "acceleration"),
    "rad/s^2": (1.0, "angular acceleration"),
    "deg/s^2": (0.017453292519943295, "angular acceleration"),
    "°/s^2": (0.017453292519943295, "angular acceleration"),
    "N": (1.0, "force"),
    "newton": (1.0, "force"),
    "kN": (1000.0, "force"),
    "mN": (0.001, "force"),
    "N m": (1.0, "torque"),
    "N*m": (1.0, "torque"),
    "N/m": (1.0, "stiffness"),
    "kN/m": (1000.0, "stiffness"),
    "N m/rad": (1.0, "torsional stiffness"),
    "N m/deg": (57.29577951308232, "torsional stiffness"),
    "N m/°": (57.29577951308232, "torsional stiffness"),
    "N*m/rad": (1.0, "torsional stiffness"),
    "N*m/deg": (57.29577951308232, "torsional stiffness"),
    "N*m/°": (57.29577951308232, "torsional stiffness"),
    "N s/m": (1.0, "damping"),
    "N*s/m": (1.0, "damping"),
    "N m s/rad": (1.0, "torsional damping"),
    "N*m*s/rad": (1.0, "torsional damping"),
    "m/m^0.5": (1.0, "noise per root length"),
    "rad/rad^0.5": (1.0, "noise per root angle"),
    "deg/deg^0.5": (0.13211090992020036, "noise per root angle"),
    "rad/m^0.5": (1.0, "drift per root length"),
    "deg/m^0.5": (0.017453292519943295, "drift per root length"),
    "m^2": (1.0, "area"),
    "m²": (1.0, "area"),
}
"""Units as they are written, each with its factor to SI (by a calculator) and its dimension."""


@pytest.mark.parametrize("unit", FACTORS)
def test_units_have_their_factors_to_the_last_digit(unit):
    factor, dimension = FACTORS[unit]
    assert read_quantity(f"1 {unit}").dimension == dimension
    assert to_si(1.0, unit) == pytest.approx(factor, rel=1e-15)
    assert read_unit(unit)[0] == factor


@pytest.mark.parametrize("unit", ["cm", "deg", "min", "kg", "km/h", "%"])
def test_a_number_in_a_unit_is_found_again(unit):
    for number in (1.0, 0.7, 12.5, 95.0):
        assert from_si(to_si(number, unit), unit) == pytest.approx(number, rel=1e-15)


def test_products_that_are_written_nowhere_else_are_calculated():
    assert read_quantity("2 cm/min").value == pytest.approx(0.02 / 60)
    assert read_quantity("3 kg m²/s²").dimension == "torque"
    assert read_quantity("2 kHz").dimension == "frequency"
