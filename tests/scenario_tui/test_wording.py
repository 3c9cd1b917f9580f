"""Numbers and words as people read them."""

from __future__ import annotations

import math
import sys

import pytest

from daemon.protocol import RunState
from daemon.verdict import Outcome
from scenario_tui import wording
from scenario_tui.summary import cells, problems, report
from tests.scenario_tui.fake import CAMPAIGN, FakeDaemon, make_row, make_rows


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.03124, "m", "+0.0312 m"),
        (-0.03124, "m", "−0.0312 m"),
        (887.5, "s", "+888 s"),
        (1234.5, "s", "+1234 s"),
        (0.05, "", "+0.05"),
        (0.05, "1", "+0.05"),
        (0.0, "m", "+0 m"),
        (-sys.float_info.min, "m", "−0 m"),
        (math.inf, "m", "+∞"),
        (-math.inf, "m", "−∞"),
        (math.nan, "m", "nan"),
        (None, "m", "–"),
    ],
)
def test_margins_have_sign_three_digits_and_a_unit(value, unit, text) -> None:
    assert wording.margin(value, unit) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.4, "0 s"),
        (59.4, "59 s"),
        (61, "1 min 01 s"),
        (3599.6, "1 h 00 min"),
        (7500, "2 h 05 min"),
        (200_000, "2 d 7 h"),
        (None, "–"),
        (math.inf, "–"),
        (-3.0, "0 s"),
    ],
)
def test_durations_are_for_people(seconds, text) -> None:
    assert wording.duration(seconds) == text


@pytest.mark.parametrize(
    ("age", "text"),
    [(0, "0 s ago"), (-5, "0 s ago"), (240, "4 min ago"), (90_000, "25 h ago"), (1e6, "11 d ago")],
)
def test_ages_have_one_unit(age, text) -> None:
    assert wording.ago(1000.0, 1000.0 + age) == text


def test_every_outcome_and_state_has_a_glyph_and_a_style() -> None:
    for word in (*Outcome, *(state for state in RunState if state is not RunState.DONE)):
        assert wording.glyph_word(str(word)).endswith(str(word))
        assert str(word) in wording.STYLES
        assert str(word) in wording.SEVERITY


def test_counting_uses_the_plural_for_all_but_one() -> None:
    assert wording.counted(1, "run") == "1 run"
    assert wording.counted(0, "run") == "0 runs"
    assert wording.counted(12_000, "run") == "12,000 runs"


def test_a_cell_is_told_by_its_gravest_repeat() -> None:
    first, second = cells(make_rows())
    assert (first.scenario, first.sut, len(first.rows)) == ("S1", "pilot", 5)
    assert first.words == {"inconclusive": 1, "pass": 4}
    assert second.worst is not None
    assert second.worst.margin == -0.12


def test_margins_of_different_oracles_are_not_compared() -> None:
    rows = [
        make_row(0, outcome=Outcome.FAIL, oracle="in-time", margin=-300.0, unit="s"),
        make_row(1, outcome=Outcome.FAIL, oracle="no-contact", margin=-0.1, unit="m"),
        make_row(2, outcome=Outcome.FAIL, oracle="no-contact", margin=-0.2, unit="m"),
    ]
    (cell,) = cells(rows)
    assert cell.worst is rows[2]


def test_an_unknown_margin_is_not_the_worst_one_known() -> None:
    rows = [make_row(0, margin=None), make_row(1, margin=0.3)]
    (cell,) = cells(rows)
    assert cell.worst is rows[1]


def test_runs_without_a_verdict_do_not_hide_the_margins_of_the_others() -> None:
    cancelled = make_row(1, state=RunState.CANCELLED, outcome=None, oracle="", margin=None)
    (cell,) = cells([make_row(0), cancelled])
    assert cell.worst is not None
    assert cell.worst.index == 0
    (nothing,) = cells([cancelled])
    assert nothing.worst is cancelled


def test_problems_come_gravest_first() -> None:
    assert [row.index for row in problems(make_rows())] == [5, 6, 9, 4]


def test_a_report_looks_closer_at_cells_and_problems_only() -> None:
    fake = FakeDaemon()
    found = report(fake, fake.rows)
    assert set(found.details) == {f"{CAMPAIGN}.{i}" for i in (4, 5, 6)}
    assert found.evidence(fake.rows[6]).object == "door-1"
