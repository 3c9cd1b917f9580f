"""The oracle language: what can be said, and what is answered to what cannot."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.oracle import (
    SIGNALS,
    Amount,
    Leg,
    Signal,
    Statistic,
    Temporal,
    Until,
    kind_of,
    margin_kind,
    parse_oracle,
    thing_of,
)
from grammars.text.diagnostics import InputError, Where
from grammars.text.expressions import Comparison, Function, Logic, Not, Number, render

HERE = Where("navigation.oracles.yaml", 4, 12)


def parse(text):
    return parse_oracle("it", text, HERE)


def refusal(text):
    with pytest.raises(InputError) as caught:
        parse(text)
    assert len(caught.value.findings) == 1
    return caught.value.findings[0]


def predicate(text):
    judgement = parse(f"always({text})").judgement
    assert isinstance(judgement, Temporal)
    return judgement.predicate


@pytest.mark.parametrize(
    "text",
    [
        "reached(mission, 0.25 m)",
        "always(loc.error <= 0.35 m)",
        "fraction(loc.inside_2sigma) >= 95 %",
        "never(clearance(0.35 m, 0.20 m) <= 0 m)",
        "always(clearance(0.55 m, 0.433 m) >= 0 m)",
        "time(clearance(0.55 m, 0.433 m) < 0 m)",
    ],
)
def test_every_oracle_of_the_paper_can_be_said(text):
    assert parse(text).text == text


def test_a_comparison_knows_its_sides_and_si_values():
    judgement = parse("always(loc.error <= 35 cm)").judgement
    assert isinstance(judgement, Temporal)
    compared = judgement.predicate
    assert isinstance(compared, Comparison)
    assert (compared.operator, compared.left) == ("<=", Signal("loc.error", (), 7))
    assert isinstance(compared.right, Number)
    assert compared.right.value == pytest.approx(0.35)


def test_percent_means_what_people_write():
    judgement = parse("fraction(contact) <= 95 %").judgement
    assert isinstance(judgement, Amount)
    assert judgement.limit is not None
    assert judgement.limit.number.value == 0.95


@pytest.mark.parametrize("operator", ["fraction", "time", "longest", "count"])
def test_an_amount_without_a_limit_is_a_measure(operator):
    assert parse(f"{operator}(contact)").is_measure


@pytest.mark.parametrize("operator", ["max", "min", "mean", "median", "final", "p95"])
def test_a_statistic_is_a_measure_until_it_has_a_limit(operator):
    assert parse(f"{operator}(speed)").is_measure
    assert not parse(f"{operator}(speed) <= 1 m/s").is_measure


def test_limits_can_be_negative():
    judgement = parse("min(clearance) >= -2 cm").judgement
    assert isinstance(judgement, Statistic)
    assert judgement.limit is not None
    assert judgement.limit.number.value == pytest.approx(-0.02)


def test_a_window_and_a_guard_belong_to_the_oracle():
    oracle = parse("eventually within 2 min (mission.reached >= 3) when not contact")
    assert isinstance(oracle.judgement, Temporal)
    assert oracle.judgement.within is not None
    assert oracle.judgement.within.value == 120.0
    assert oracle.guard is not None
    assert render(oracle.guard) == "not contact"


def test_until_has_a_release_and_may_have_a_deadline():
    judgement = parse("never(contact) until within 1 min (mission.reached >= 1)").judgement
    assert isinstance(judgement, Until)
    assert (judgement.operator, render(judgement.release)) == ("never", "mission.reached >= 1")
    assert judgement.within is not None
    assert judgement.within.value == 60.0


@pytest.mark.parametrize(
    ("text", "leg"),
    [
        ("count(contact) <= 2 on leg 3", Leg(3, "", 27)),
        ("max(speed) <= 2 m/s on leg door-17 when contact", Leg(0, "door-17", 27)),
        ("never(contact) on leg kitchen", Leg(0, "kitchen", 22)),
        ('never(contact) on leg "café 2"', Leg(0, "café 2", 22)),
    ],
)
def test_a_leg_is_named_by_number_or_waypoint(text, leg):
    oracle = parse(text)
    assert oracle.leg == leg
    assert (oracle.guard is not None) == ("when" in text)


def test_an_object_may_come_before_the_size_of_the_box():
    judgement = parse("min(clearance(door-17, 0.35 m, 0.2 m))").judgement
    assert isinstance(judgement, Statistic)
    assert isinstance(judgement.signal, Signal)
    assert thing_of(judgement.signal) == Signal("door-17", (), 14)
    assert render(judgement.signal) == "clearance(door-17, 0.35 m, 0.2 m)"


def test_and_binds_tighter_than_or():
    parsed = predicate("contact or contact and loc.inside_2sigma")
    assert isinstance(parsed, Logic)
    assert parsed.operator == "or"
    assert render(parsed) == "contact or (contact and loc.inside_2sigma)"


def test_products_bind_tighter_than_sums_and_group_from_the_left():
    parsed = predicate("speed - speed - 2 * speed > 0 m/s")
    assert isinstance(parsed, Comparison)
    assert render(parsed.left) == "(speed - speed) - (2 * speed)"


def test_arithmetic_carries_units():
    oracle = parse("max(speed * 2 s + loc.error) <= 3 m")
    assert isinstance(oracle.judgement, Statistic)
    kind = kind_of(oracle.judgement.signal)
    assert kind is not None
    assert kind.unit == "m"


def test_a_unit_ends_where_a_signal_begins():
    oracle = parse("max(0.5 m/loc.error)")
    assert isinstance(oracle.judgement, Statistic)
    assert render(oracle.judgement.signal) == "0.5 m / loc.error"


@pytest.mark.parametrize("name", ["Follow Path", "a/b", "Spin-2", "not"])
def test_a_node_may_have_any_name_in_quotes(name):
    oracle = parse(f"never(bt.node('{name}'))")
    (signal,) = oracle.signals()
    assert thing_of(signal) == Signal(name, (), 14)
    quoted = name if name == "Spin-2" else f'"{name}"'
    assert render(signal) == f"bt.node({quoted})"
    assert render(predicate(render(signal))) == render(signal)


def test_names_may_contain_hyphens():
    oracle = parse("min(door-17.distance)")
    assert isinstance(oracle.judgement, Statistic)
    assert oracle.judgement.signal == Signal("door-17.distance", (), 4)


def test_a_mix_of_quantities_has_no_single_unit():
    same = margin_kind(predicate("loc.error < 1 m and clearance > 0 m"))
    assert same is not None
    assert same.unit == "m"
    assert margin_kind(predicate("loc.error < 1 m and speed < 1 m/s")) is None
    assert margin_kind(predicate("loc.error < 1 m and not contact")) is None


def test_what_was_not_read_from_a_text_stands_at_its_beginning():
    here, there = Signal("speed"), Number(1.0, SIGNALS["speed"].dimension, "1 m/s")
    assert here == Signal("speed", (), 0)
    assert there.column == 0
    compared = Comparison("<", here, there)
    made = (compared, Not(compared), Logic("or", (compared,)), Function("abs", (here,)), Leg(1, ""))
    assert [node.column for node in made] == [0] * 5


LENGTHS = st.sampled_from(["loc.error", "clearance", "0.5 m", "clearance(0.3 m, 0.2 m)"])


def sums(leaves):
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from("+-"), inner).map(lambda t: f"({' '.join(t)})"),
            inner.map(lambda text: f"abs({text})"),
            inner.map(lambda text: f"-{text}"),
            inner.map(lambda text: f"2 * {text}"),
        ),
        max_leaves=4,
    )


COMPARISONS = st.tuples(sums(LENGTHS), st.sampled_from(["<", "<=", ">", ">="]), sums(LENGTHS)).map(
    " ".join
)
PREDICATES = st.recursive(
    COMPARISONS | st.just("contact"),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["and", "or"]), inner).map(lambda t: f"({' '.join(t)})"),
        inner.map(lambda text: f"not ({text})"),
    ),
    max_leaves=5,
)


@given(PREDICATES)
def test_rendering_a_predicate_says_the_same(text):
    rendered = render(predicate(text))
    assert render(predicate(rendered)) == rendered


@given(st.text(alphabet="always(loc.error)<=0 %ms-+*/whenotu5,g", max_size=40))
def test_any_text_is_either_an_oracle_or_an_input_error(text):
    try:
        parse(text)
    except InputError as error:
        assert error.findings


@pytest.mark.parametrize(
    "text",
    [
        f"never({'(' * 400}contact{')' * 400})",
        f"max({'-' * 900}speed)",
        f"never({'not ' * 900}contact)",
        f"max({'speed + ' * 400}speed)",
    ],
)
def test_monsters_are_refused_instead_of_exhausting_the_parser(text):
    assert re.search("nest|longer", refusal(text).message)


def test_what_is_long_or_deep_but_no_monster_is_read():
    assert parse("never(contact)" + " " * 986).text.startswith("never(contact)")
    assert "longer than 1000" in refusal("never(contact)" + " " * 987).message
    parse(f"never({'(' * 15}contact{')' * 15})")


def test_every_declared_signal_can_be_used():
    for name, kind in SIGNALS.items():
        arguments = "(robot, door-17)" if kind.relates else "(Spin)" if kind.takes_node else ""
        signal = name + arguments
        parse(f"never({signal})" if kind.dimension is None else f"max({signal})")
