"""What a run that goes on is judged by: its signals, verdicts and log so far."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import judge
from daemon.judging.running import MOST_COLUMNS, MOST_LINES, RunningJudge
from daemon.model.live_judgement import LiveJudgement, LiveSignal, pack_judgement, unpack_judgement
from daemon.model.spec import OracleText
from daemon.trace import ContactRecord, EventRecord, ProgressRecord
from grammars.text import codec
from tests.daemon.judging.oracles.traces import along, cut, make_trace, mission, times, track

ORACLES = {
    "arrives": "reached(mission, 0.3 m)",
    "contact": "never(contact)",
    "accuracy": "always(loc.error <= 0.3 m)",
    "share": "fraction(speed > 0.1 m/s) >= 50 %",
}


def whole():
    """Ten seconds at 0.5 m/s; wrong by 0.4 m for a second, three touches of which two are one."""
    time = times(10.0)
    motion = along(time)
    wrong = np.where((time >= 4.0) & (time < 5.0), 0.4, 0.1)
    hits = [
        ContactRecord(at, "robot", "wall-north", (at, 1.0), (0.0, 1.0), 0.01)
        for at in (6.0, 6.05, 8.0)
    ]
    trace = make_trace(
        motion,
        estimate=track(time, motion.x, wrong),
        contacts=tuple(hits),
        progress=(ProgressRecord(0.0, 0, 0, "active"), ProgressRecord(5.0, 1, 1, "succeeded")),
        goal=mission((2.5, 0.0)),
    )
    events = (EventRecord(1.0, "sut", "starts\x1b[2J\nnow"), EventRecord(7.0, "door-17", "opens"))
    spec = replace(trace.spec, oracles=tuple(OracleText(k, v) for k, v in ORACLES.items()))
    return replace(trace, spec=spec, events=events)


def names(judgement):
    return [signal.name for signal in judgement.signals]


def test_signals_and_verdicts_so_far():
    judgement = RunningJudge().judge(cut(whole(), 4.5))
    assert judgement.time == 4.5
    assert names(judgement) == ["loc.error", "clearance", "clearance(doors)", "speed", "contact"]
    error = judgement.signals[0]
    assert (error.limits, error.readers) == ((0.3,), ("accuracy",))
    assert error.against == ((pytest.approx(4.0), pytest.approx(4.5)),)
    assert len(error.low) <= MOST_COLUMNS
    assert max(value for value in error.high if value is not None) == pytest.approx(0.4)
    states = {one.verdict.oracle: (one.verdict.outcome, one.final, one.open)
              for one in judgement.verdicts}  # fmt: skip
    assert states == {
        "arrives": ("pass", True, False),
        "contact": ("pass", False, False),
        "accuracy": ("fail", True, False),
        "share": ("pass", False, False),
    }


def test_the_log_tells_events_touches_waypoints_and_decisions_in_order_of_time():
    judgement = RunningJudge().judge(cut(whole(), 9.0))
    assert [(line.time, line.source, line.text) for line in judgement.log] == [
        (1.0, "sut", "starts\N{REPLACEMENT CHARACTER}[2J now"),
        (4.0, "accuracy", "decided: fail"),
        (5.0, "mission", "w1 reached, 1 of 1"),
        (5.0, "mission", "succeeded"),
        (5.0, "arrives", "decided: pass (w1)"),
        (6.0, "contact", "robot touches wall-north"),
        (6.0, "contact", "decided: fail (wall-north)"),
        (7.0, "door-17", "opens"),
        (8.0, "contact", "robot touches wall-north"),
    ]


def test_a_long_log_is_told_by_its_end():
    events = tuple(EventRecord(i / 100.0, "sut", f"line {i}") for i in range(900))
    judgement = RunningJudge().judge(cut(replace(whole(), events=events), 3.9))
    assert (len(judgement.log), judgement.log_before) == (MOST_LINES, 391 - MOST_LINES)
    assert judgement.log[-1].text == "line 390"


def test_what_was_decided_stays_where_it_was():
    judge_, trace = RunningJudge(), whole()
    first = judge_.judge(cut(trace, 4.6)).log
    last = judge_.judge(trace).log
    assert [line.source for line in first if "decided" in line.text] == ["accuracy", "arrives"]
    assert {line for line in first if "decided" in line.text} <= {*last}


def test_the_last_judgement_is_what_the_run_is_judged_by():
    trace = whole()
    judgement = RunningJudge().judge(trace)
    assert tuple(one.verdict for one in judgement.verdicts) == judge(trace, trace.spec.oracles)
    assert all(one.final for one in judgement.verdicts)


def test_a_trace_that_cannot_be_trusted_has_error_verdicts_and_no_signals():
    judgement = RunningJudge().judge(replace(cut(whole(), 4.5), problems=("broken",)))
    assert judgement.signals == ()
    assert {one.verdict.outcome for one in judgement.verdicts} == {"error"}


def test_a_judgement_travels_small():
    judgement = replace(RunningJudge().judge(cut(whole(), 9.0)), run="c.0")
    packed = pack_judgement(judgement)
    assert unpack_judgement(packed) == judgement
    assert len(packed) < 4000


@pytest.mark.parametrize("change", [lambda d: d[:-5], lambda d: b"x" + d, lambda d: b""])
def test_what_is_no_judgement_is_refused(change):
    packed = pack_judgement(LiveJudgement("c.0", 1.0, (), (), (), (), ()))
    with pytest.raises(ValueError):  # noqa: PT011
        unpack_judgement(change(packed))


def test_a_judgement_whose_values_do_not_go_together_is_refused():
    signal = LiveSignal("speed", "m/s", 0.0, 1.0, (0.0, 0.1), (0.2,))
    packed = pack_judgement(LiveJudgement("c.0", 1.0, (signal,), (), (), (), ()))
    with pytest.raises(ValueError, match="speed"):
        unpack_judgement(packed)


def test_a_judgement_that_unpacks_without_end_is_refused():
    import zlib

    bomb = zlib.compress(b" " * 2**24 + codec.to_json(LiveJudgement("c", 1.0, (), (), (), (), ())))
    with pytest.raises(ValueError, match="more than"):
        unpack_judgement(bomb)
