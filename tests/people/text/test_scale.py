"""Round numbers on axes, and limits in view."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenario_tui.text.scale import fit_axis, mark_axis, round_step, tick_text

VALUES = st.floats(-1e6, 1e6, allow_nan=False)


@given(st.floats(1e-9, 1e9))
def test_steps_are_one_two_or_five_and_not_too_small(least):
    step = round_step(least)
    digit = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    assert min(abs(digit - one) for one in (1.0, 2.0, 5.0)) < 1e-6
    assert least * (1 - 1e-6) <= step <= 2.5 * least * (1 + 1e-6)


@given(VALUES, VALUES, st.integers(2, 60))
def test_an_axis_always_has_a_tick_and_none_outside(a, b, rows):
    scale = mark_axis(min(a, b), max(a, b), rows, 2.0)
    assert scale.low < scale.high
    assert scale.ticks
    assert all(-1e-6 <= scale.share(tick) <= 1 + 1e-6 for tick in scale.ticks)
    assert len(scale.ticks) <= rows + 2


@given(VALUES, VALUES, VALUES, st.integers(2, 60))
def test_values_and_limits_near_them_are_in_view(a, b, limit, rows):
    low, high = min(a, b), max(a, b)
    scale = fit_axis(low, high, (limit,), rows)
    assert scale.low <= low <= high <= scale.high
    if low < high and low - (high - low) <= limit <= high + (high - low):
        assert -1e-9 <= scale.share(limit) <= 1 + 1e-9


@pytest.mark.parametrize(
    ("value", "step", "text"),
    [(0.05, 0.05, "0.05"), (-20.0, 10.0, "−20"), (0.0, 0.5, "0.0"), (3e7, 1e7, "3e7"),
     (2e-6, 1e-6, "2e−6"), (-0.0, 1.0, "0"), (1500.0, 500.0, "1500")],
)  # fmt: skip
def test_ticks_are_as_short_as_their_step_allows(value, step, text):
    assert tick_text(value, step) == text
