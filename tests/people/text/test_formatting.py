"""Numbers, words, bars, axes and printed lines as people read them."""

import math
import sys
import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from daemon.model.verdicts import Evidence, Outcome, RunState, Verdict
from grammars.text.words import count_noun
from scenario_tui.text import formatting
from scenario_tui.text.formatting import last_lines, printed_lines
from scenario_tui.text.run_text import evidence_parts
from scenario_tui.text.scale import fit_axis, mark_axis, round_step, tick_text
from scenario_tui.text.styles import SEVERITY, dashboard_theme, terminal_theme

TINY, HUGE, UNKNOWN = sys.float_info.min, math.inf, math.nan
MARGINS = [0.03124, -0.03124, 887.5, 1234.5, 0.0, -TINY, 3.56e-52, -4.31e-05, HUGE, -HUGE, UNKNOWN]
SECONDS = [0.4, 59.4, 61, 3599.6, 7500, 200_000, None, HUGE, -3.0]
AGES = [0, -5, 240, 90_000, 1e6]
SHARES = [0.0, 0.01, 0.5, -0.3, 7.0, -HUGE, UNKNOWN]
TICKS = [
    (0.05, 0.05),
    (-20, 10),
    (0.0, 0.5),
    (3e7, 1e7),
    (2e-6, 1e-6),
    (-0.0, 1.0),
    (1500, 500),
]
PRINTED = (
    "",
    "one\ntwo\n",
    "one\r\ntwo\r\n\r\n",
    "10 %\r50 %\rdone\nnext",
    "\x1b[1;31mred\x1b[0m \x1b[2Jgone",
    "\x1b]0;a title\x07text \x1b]8;;http://x\x1b\\link",
    "\x1bcreset \x1b(Bset",
    "bell\x07 back\x08",
    "turned \N{RIGHT-TO-LEFT OVERRIDE}round",
    "a\tb",
)
"""What a program printed, of which lines are left as on a terminal."""


def test_numbers_and_lines_are_told_as_people_read_them(golden):
    parts = {
        "margin": {f"{one} m": formatting.margin(one, "m") for one in MARGINS},
        "margin without a unit": {
            f"{one} {unit}": formatting.margin(one, unit)
            for one, unit in ((0.05, ""), (0.05, "1"), (4.31e-05, ""), (None, "m"))
        },
        "duration": {f"{one} s": formatting.duration_text(one) for one in SECONDS},
        "age": {f"{one} s": formatting.age_text(1000.0, 1000.0 + one) for one in AGES},
        "bar": {str(one): f"[{formatting.margin_bar(one)}]" for one in SHARES},
        "count": {str(one): count_noun(one, "run") for one in (0, 1, 12_000)},
        "seed": {str(one): formatting.brief_seed(one) for one in (3386250816931739734, 20240101)},
        "printed": {repr(one): printed_lines(one) for one in PRINTED},
        "last": {f"{one} of 5": last_lines("1\n2\n3\n4\n5", one) for one in (2, 5, 9, None)},
        "tick": {f"{one} by {step}": tick_text(one, step) for one, step in TICKS},
    }
    lines = (f"{name}  {one}  {told}" for name, part in parts.items() for one, told in part.items())
    assert len(last_lines("\n".join("x" * 50))[0]) == 40
    golden("formatting.txt", "\n".join((*lines, "")))


def test_every_outcome_and_state_has_a_glyph_and_a_style():
    for word in (*Outcome, *(state for state in RunState if state is not RunState.DONE)):
        assert formatting.glyph_word(str(word)).endswith(str(word))
        assert str(word) in SEVERITY
        assert str(word) in terminal_theme().styles.keys() & dashboard_theme().styles.keys()


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


@given(st.text(alphabet=st.characters(), max_size=200))
def test_no_sign_is_left_that_a_terminal_obeys(text):
    left = {sign for line in printed_lines(text) for sign in line}
    assert not {unicodedata.category(sign) for sign in left} & {"Cc", "Cs", "Zl", "Zp"}
    turning = ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
    assert not {unicodedata.bidirectional(sign) for sign in left} & set(turning)


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
