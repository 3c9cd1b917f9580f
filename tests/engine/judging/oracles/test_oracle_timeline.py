"""When a run spoke against an oracle, and what it is drawn against."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import OracleTimeline, SignalSampler, oracle_timeline
from daemon.model.spec import OracleText
from daemon.trace import CommandTrack, ProgressRecord
from grammars.text.expressions import render
from tests.engine.judging.oracles.traces import along, make_trace, mission, still, times, track


def journey():
    """Ten seconds along x at 0.5 m/s, twice a second; the estimate is 0.5 m off from 3 s to 5 s
    and from 7 s to 8 s, else 0.1 m. The first of two waypoints is reached at 6 s.
    """
    time = times(10.0, 2.0)
    motion = along(time)
    off = ((time >= 3.0) & (time < 5.0)) | ((time >= 7.0) & (time < 8.0))
    progress = (ProgressRecord(0.0, 0, 0, "active"), ProgressRecord(6.0, 1, 1, "active"))
    return make_trace(
        motion,
        goal=mission((3.0, 0.0), (5.0, 0.0)),
        estimate=track(time, motion.x, np.where(off, 0.5, 0.1)),
        progress=progress,
    )


def timeline(text):
    return oracle_timeline(OracleText("it", text), SignalSampler(journey()))


WRONG = ((3.0, 5.0), (7.0, 8.0))
RIGHT = ((0.0, 3.0), (5.0, 7.0), (8.0, 10.0))


@pytest.mark.parametrize(
    ("text", "against"),
    [
        ("always(loc.error <= 0.3 m)", WRONG),
        ("always(loc.error < 0.5 m)", WRONG),
        ("always(loc.error <= 0.5 m)", ()),
        ("never(loc.error > 0.3 m)", WRONG),
        ("eventually(loc.error > 0.3 m)", ()),
        ("always(loc.error <= 0.3 m) when elapsed >= 4 s", ((4.0, 5.0), (7.0, 8.0))),
        ("always(loc.error <= 0.3 m) until (mission.reached >= 1)", ((3.0, 5.0),)),
        ("always(loc.error <= 0.3 m) until (loc.error >= 0.5 m)", ()),
        ("never(loc.error >= 0.5 m) until (mission.reached >= 1)", ((3.0, 5.0),)),
        ("always(loc.error <= 0.3 m) on leg 2", ((7.0, 8.0),)),
        ("time(loc.error > 0.3 m) <= 1 s", WRONG),
        ("time(loc.error > 0.3 m) < 1 s", WRONG),
        ("time(loc.error <= 0.3 m) >= 9 s", WRONG),
        ("time(loc.error <= 0.3 m) > 9 s", WRONG),
        ("time(loc.error >= 0.5 m) >= 9 s", RIGHT),
        ("time(loc.error > 0.3 m)", ()),
        ("max(loc.error) <= 0.3 m", WRONG),
        ("min(loc.error) >= 0.3 m", RIGHT),
        ("mean(loc.error) <= 0.01 m", ()),
        ("max(loc.error)", ()),
        ("reached(mission, 0.1 m)", ()),
    ],
)
def test_a_run_speaks_against_an_oracle_while_it_does_not_hold(text, against):
    assert timeline(text).against == against


@pytest.mark.parametrize(
    ("text", "limits"),
    [
        ("always(loc.error <= 0.3 m)", (("loc.error", 0.3),)),
        ("always(0.3 m >= loc.error)", (("loc.error", 0.3),)),
        ("always(speed.forward >= -0.2 m/s)", (("speed.forward", -0.2),)),
        ("never(loc.error > 30 cm and not (speed < 0.1 m/s))",
         (("loc.error", 0.3), ("speed", 0.1))),
        ("always(abs(loc.error) <= 0.3 m)", ()),
        ("always(loc.error <= speed * 1 s)", ()),
        ("time(loc.error > 0.3 m) <= 1 s", (("loc.error", 0.3),)),
        ("always(loc.error <= 0.3 m) until (mission.reached >= 1)",
         (("loc.error", 0.3), ("mission.reached", 1.0))),
        ("max(loc.error) <= 0.4 m", (("loc.error", 0.4),)),
        ("max(abs(loc.error)) <= 0.4 m", ()),
        ("max(loc.error)", ()),
        ("reached(mission, 0.1 m)", ()),
    ],
)  # fmt: skip
def test_limits_are_the_constants_that_signals_are_compared_with(text, limits):
    found = timeline(text).limits
    assert [one.signal for one in found] == [name for name, _ in limits]
    assert [one.value for one in found] == pytest.approx([value for _, value in limits])


def test_signals_are_named_once():
    found = timeline("always(loc.error <= 0.3 m or speed < 1 m/s and loc.error < 2 m)")
    assert [render(signal) for signal in found.signals] == ["loc.error", "speed"]
    assert found.oracle == "it"


def test_what_cannot_be_read_or_seen_has_no_course():
    assert timeline("always(lok.error <= 0.3 m)") == OracleTimeline("it", (), (), ())
    nothing = np.empty(0)
    none = make_trace(still(nothing), goal=mission((1.0, 0.0)))
    none = replace(none, command=CommandTrack(nothing, nothing, nothing, nothing))
    empty = oracle_timeline(OracleText("it", "always(speed <= 0.3 m/s)"), SignalSampler(none))
    assert (empty.against, [render(s) for s in empty.signals]) == ((), ["speed"])
