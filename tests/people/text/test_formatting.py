"""Numbers and words as people read them."""

import math
import sys

import pytest

from daemon.model.run_state import RunState
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text.words import count_noun
from scenario_tui.text import formatting
from scenario_tui.text.run_text import evidence_parts
from scenario_tui.text.styles import SEVERITY, dashboard_theme, terminal_theme


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
        (3.56e-52, "m/s", "+0 m/s"),
        (-4.31e-05, "m", "−0.000043 m"),
        (4.31e-05, "", "+4.31e−05"),
        (math.inf, "m", "+∞"),
        (-math.inf, "m", "−∞"),
        (math.nan, "m", "–"),
        (None, "m", "–"),
    ],
)
def test_margins_have_sign_three_digits_and_a_unit(value, unit, text):
    assert formatting.margin(value, unit) == text


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
def test_durations_are_for_people(seconds, text):
    assert formatting.duration_text(seconds) == text


@pytest.mark.parametrize(
    ("age", "text"),
    [(0, "0 s ago"), (-5, "0 s ago"), (240, "4 min ago"), (90_000, "25 h ago"), (1e6, "11 d ago")],
)
def test_ages_have_one_unit(age, text):
    assert formatting.age_text(1000.0, 1000.0 + age) == text


@pytest.mark.parametrize(
    ("share", "bar"),
    [
        (0.0, "    │    "),
        (0.01, "    │▌   "),
        (0.5, "    │██  "),
        (-0.3, "  ▐█│    "),
        (7.0, "    │████"),
        (-math.inf, "████│    "),
        (math.nan, "    │    "),
    ],
)
def test_bars_grow_from_the_middle_to_the_side_of_the_verdict(share, bar):
    assert formatting.margin_bar(share) == bar


def test_every_outcome_and_state_has_a_glyph_and_a_style():
    for word in (*Outcome, *(state for state in RunState if state is not RunState.DONE)):
        assert formatting.glyph_word(str(word)).endswith(str(word))
        assert str(word) in SEVERITY
        assert str(word) in terminal_theme().styles.keys() & dashboard_theme().styles.keys()


def test_counting_uses_the_plural_for_all_but_one():
    assert count_noun(1, "run") == "1 run"
    assert count_noun(0, "run") == "0 runs"
    assert count_noun(12_000, "run") == "12,000 runs"


def test_seeds_are_shown_short():
    assert formatting.brief_seed(3386250816931739734) == "338625…"
    assert formatting.brief_seed(20240101) == "20240101"


def test_moments_in_notes_are_told_as_all_others():
    note = "first at 34.65 s; the trace ends at 120.00 s, before the run; until 7.25 s, 0.25 s long"
    seen = Evidence(41.04, object="door_3", note=note)
    verdict = Verdict("clear", "", Outcome.FAIL, -0.1, -0.1, "m", seen)
    said = formatting.verdict_line(verdict)
    assert said.startswith("clear: −0.1 m at 41.0 s, door_3, first at 34.6 s; the trace ends at ")
    assert "ends at 120.0 s, before the run; until 7.2 s, 0.25 s long" in said
    assert said.removeprefix("clear: ") == ", ".join(
        [" ".join(evidence_parts(verdict)[:2]), *evidence_parts(verdict)[2:]]
    )
    assert seen.note == note
