"""What is told of runs that go on is read where it can be drawn, whoever has sent it."""

import json
import zlib
from dataclasses import replace

import pytest

from daemon.batch.client import read_snapshot
from daemon.model.live_judgement import (
    DoorMotion,
    LiveJudgement,
    LiveSignal,
    LogLine,
    SignalLimit,
    pack_judgement,
    unpack_judgement,
)
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.model.geometry import Pose2
from grammars.model.mission import MOST_WAYPOINTS
from grammars.text import codec

SNAPSHOT = LiveSnapshot(
    "c.0", Snapshot(1.0, 60.0, Pose2(1.0, 2.0), Pose2(1e30), 0, 3, (0.5,), spread=(1e15, 0.0, 1.0))
)
VERDICT = Verdict("clear", "always(clearance >= 0 m)", Outcome.PASS, 0.1, 0.1, "m", Evidence(1.0))
SPEED = LiveSignal(
    "speed", "m/s", 0.0, 2.0, (0.0, None), (1e30, None), (SignalLimit(0.5, "above"),), ((0.0, 1.0),)
)
JUDGEMENT = LiveJudgement(
    "c.0",
    2.0,
    (
        LiveSignal(
            "speed",
            "m/s",
            0.0,
            2.0,
            (0.0, None),
            (1e30, None),
            (SignalLimit(0.5, "above"),),
            ((0.0, 1.0),),
        ),
    ),
    (VERDICT,),
    (DoorMotion(1.0, "door", opens=True),),
    (1.5,),
    (LogLine(1.0, "sut", "hello"),),
)
FAR = 1e300
EMPTY = {"name": "speed", "unit": "m/s", "start": 0.0, "end": 2.0, "low": [], "high": []}
REFUSED = "validation error|snapshot of more than|do not go together"


def changed(value, path, new):
    """Return the JSON of a value with something else at ``path``."""
    document = json.loads(codec.to_json(value))
    *way, last = (int(step) if step.isdigit() else step for step in path.split("."))
    place = document
    for step in way:
        place = place[step]
    place[last] = new
    return json.dumps(document).encode()


def test_a_run_is_told_by_every_waypoint_that_a_mission_may_have():
    done = replace(JUDGEMENT, reached=tuple(map(float, range(MOST_WAYPOINTS))))
    assert unpack_judgement(pack_judgement(done)) == done


def test_what_runs_tell_is_read():
    assert read_snapshot(codec.to_json(SNAPSHOT)) == SNAPSHOT
    assert unpack_judgement(pack_judgement(JUDGEMENT)) == JUDGEMENT


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("time", FAR), ("time", -FAR), ("limit", FAR), ("reached", -1), ("waypoints", 10**400),
        ("spread", [FAR, 0.0, FAR]), ("returns", [10**400, 1]), ("plan", [1, -(10**17)]),
        ("contacts", [10**400, 0]), ("plan", [0] * 100_000), ("waiting", "x" * 100_000),
    ],
)  # fmt: skip
def test_a_snapshot_that_no_run_tells_is_refused(path, value):
    told = changed(SNAPSHOT, f"snapshot.{path}", value)
    with pytest.raises(ValueError, match=REFUSED):
        read_snapshot(told)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("time", FAR), ("log_before", -1), ("log_before", 10**400), ("reached", [FAR]),
        ("reached", [1.0] * (MOST_WAYPOINTS + 1)), ("doors.0.time", -FAR), ("log.0.time", FAR),
        ("verdicts.0.evidence.time", FAR), ("signals.0.start", -FAR),
        ("signals.0.start", 5.0), ("signals.0.end", FAR), ("signals.0.low", [0.0]),
        ("signals.0.low", [0.0, -FAR]), ("signals.0.high", [FAR, 0.0]),
        ("signals.0.limits.0.value", FAR), ("signals.0.limits.0.side", "beside"),
        ("signals.0.limits", [{"value": 0.0}] * 5000), ("signals.0", EMPTY),
        ("signals.0.against", [[0.0, FAR]]), ("signals.0.against", [[0.0, 1.0]] * 4),
    ],
)  # fmt: skip
def test_a_judgement_that_no_run_is_told_by_is_refused(path, value):
    told = zlib.compress(changed(JUDGEMENT, path, value))
    with pytest.raises(ValueError, match=REFUSED):
        unpack_judgement(told)


def test_a_judgement_that_is_too_long_says_so():
    many = replace(JUDGEMENT, verdicts=JUDGEMENT.verdicts * 9000)
    told = unpack_judgement(pack_judgement(many))
    assert (told.run, told.time, told.signals, told.verdicts) == ("c.0", 2.0, (), ())
    assert told.log[-1].text.startswith("9000 verdicts and their signals are too long")
