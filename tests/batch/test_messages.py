"""Messages of the bus: verbs, numbers that may be said, results and pictures of bounded size."""

import json
import zlib
from dataclasses import replace

import pytest

from daemon.batch.client import Client, read_snapshot
from daemon.model import verbs
from daemon.model.live_judgement import (
    DoorMotion,
    LiveJudgement,
    LiveSignal,
    LogLine,
    SignalLimit,
    pack_judgement,
    unpack_judgement,
)
from daemon.model.messages import Completion, Count, Empty, IdRequest, RetryRequest, RunQuery
from daemon.model.spec import LARGEST_RESULT, LeadingMargin, RunResult, Snapshot, bound_result
from daemon.model.status import LiveSnapshot
from daemon.model.verbs import VERBS, DaemonClient, Role, ServerThread
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.model.geometry import Pose2
from grammars.model.mission import MOST_WAYPOINTS
from grammars.text import codec
from tests.make import make_result, make_spec

# --- verbs

METHODS = {"search": "begin_search", "extend": "ask", "progress": "ask"}
"""Verbs that a client's method of another name asks."""


class Asked(Client):
    """Says what it was asked."""

    def __init__(self):
        self.questions = []

    def ask(self, verb, request):
        self.questions.append((verb, request))
        return Count(1)


def test_verbs_are_known_by_their_names():
    assert list(VERBS)[:4] == ["overview", "campaigns", "runs", "run"]
    assert all(verb.name == name == str(verb) for name, verb in VERBS.items())
    assert len(VERBS) == 26
    for verb in VERBS.values():
        if Role.OPERATOR in verb.roles:
            assert callable(getattr(DaemonClient, METHODS.get(verb.name, verb.name)))
        # Nobody who may only look is done by the writer, whom everybody else waits for.
        assert Role.VIEWER not in verb.roles or verb.thread is not ServerThread.WRITER, verb


def test_a_clients_method_takes_the_fields_of_the_request():
    client = Asked()
    client.overview()
    client.run("c.1")
    client.runs("c", state="done", limit=7)
    assert client.retry("c", only=" lost | fail|") == 1
    assert client.questions == [
        (verbs.OVERVIEW, Empty()),
        (verbs.RUN, IdRequest("c.1")),
        (verbs.RUNS, RunQuery("c", state="done", limit=7)),
        (verbs.RETRY, RetryRequest("c", ("lost", "fail"))),
    ]
    with pytest.raises(TypeError):
        client.runs("c", colour="red")
    assert DaemonClient.disk.__doc__ == verbs.DISK.about


# --- numbers of results

VERDICT = Verdict("clear", "always(clearance >= 0 m)", Outcome.PASS, 0.1, 0.2, "m", Evidence(1.0))
LEADS = (LeadingMargin("clear", -0.01, "m", "door " * 1000, "w3"), LeadingMargin("calm", None, ""))
RESULT = make_result(make_spec(), outcome=Outcome.FAIL)
FULL = replace(VERDICT, evidence=Evidence(1.0, 0.5, 0.2))
COMPLETION = codec.to_plain(
    Completion("w", "c.0", 1, 1, replace(RESULT, verdicts=(FULL,), leads=LEADS[:1]))
)
SIGNED = {"lower", "upper", "value", "limit", "margin"}


def numbers(value, path=()):
    """Yield the path of every number in a document."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(inner, dict | list):
            yield from numbers(inner, (*path, key))
        elif isinstance(inner, int | float) and not isinstance(inner, bool):
            yield (*path, key)


def changed(document, path, new):
    """Return the JSON of a document with something else at ``path``."""
    document = place = json.loads(json.dumps(document))
    *way, last = path
    for step in way:
        place = place[step]
    place[last] = new
    return json.dumps(document).encode()


def test_no_number_of_a_result_is_beyond_what_a_run_can_give():
    paths = list(numbers(COMPLETION))
    assert len(paths) == 14
    for path in paths:
        negative = () if path[-1] in SIGNED else (-1,)
        for wrong in (float("nan"), float("inf"), float("-inf"), 1e300, *negative):
            with pytest.raises(ValueError, match=str(path[-1])):
                codec.from_json(Completion, changed(COMPLETION, path, wrong), exactly=True)


# --- results are bounded: evidence goes first, then verdicts, the outcome never


def test_a_usual_result_is_as_it_was():
    many = replace(RESULT, verdicts=RESULT.verdicts * 500, note="\N{GRINNING FACE}" * 1000)
    for usual in (RESULT, many, replace(RESULT, leads=LEADS)):
        assert bound_result(usual) is usual
    assert replace(RESULT, leads=LEADS).digest == RESULT.digest


def test_long_evidence_is_cut_and_verdicts_stay():
    evidence = Evidence(time=3.0, value=0.1, object="door " * 1000, note="\x01" * LARGEST_RESULT)
    verdict = replace(RESULT.verdicts[0], evidence=evidence)
    bound = bound_result(replace(RESULT, verdicts=(verdict,) * 3, note="y" * LARGEST_RESULT))
    assert len(codec.to_json(bound)) <= LARGEST_RESULT
    assert bound.outcome is Outcome.FAIL
    assert [v.evidence.value for v in bound.verdicts] == [0.1] * 3
    assert "notes were cut" in bound.note
    assert bound_result(bound) is bound


@pytest.mark.parametrize(
    "much", [{"note": "y" * LARGEST_RESULT}, {"verdicts": RESULT.verdicts * 5000}], ids=list
)
def test_leading_margins_survive_what_is_cut(much):
    bound = bound_result(replace(RESULT, leads=LEADS, **much))
    assert len(codec.to_json(bound)) <= LARGEST_RESULT
    assert [(lead.oracle, lead.margin) for lead in bound.leads] == [
        ("clear", -0.01),
        ("calm", None),
    ]
    assert codec.from_json(RunResult, codec.to_json(bound)) == bound


# --- live: what is told of runs that go on can be drawn, whoever has sent it

SNAPSHOT = LiveSnapshot(
    "c.0", Snapshot(1.0, 60.0, Pose2(1.0, 2.0), Pose2(1e30), 0, 3, (0.5,), spread=(1e15, 0.0, 1.0))
)
SPEED = LiveSignal(
    "speed", "m/s", 0.0, 2.0, (0.0, None), (1e30, None), (SignalLimit(0.5, "above"),), ((0.0, 1.0),)
)
JUDGEMENT = LiveJudgement(
    "c.0",
    2.0,
    (SPEED,),
    (VERDICT,),
    (DoorMotion(1.0, "door", opens=True),),
    (1.5,),
    (LogLine(1.0, "sut", "hello"),),
)
FAR = 1e300
EMPTY = {"name": "speed", "unit": "m/s", "start": 0.0, "end": 2.0, "low": [], "high": []}
REFUSED = "validation error|snapshot of more than|contradict each other"


def spoilt(value, path, new):
    way = (int(step) if step.isdigit() else step for step in path.split("."))
    return changed(codec.to_plain(value), way, new)


def test_what_runs_tell_is_read():
    assert read_snapshot(codec.to_json(SNAPSHOT)) == SNAPSHOT
    done = replace(JUDGEMENT, reached=tuple(map(float, range(MOST_WAYPOINTS))))
    for judgement in (JUDGEMENT, done):
        assert unpack_judgement(pack_judgement(judgement)) == judgement


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("time", FAR), ("time", -FAR), ("limit", FAR), ("reached", -1), ("waypoints", 10**400),
        ("spread", [FAR, 0.0, FAR]), ("returns", [10**400, 1]), ("plan", [1, -(10**17)]),
        ("contacts", [10**400, 0]), ("plan", [0] * 100_000), ("waiting", "x" * 100_000),
    ],
)  # fmt: skip
def test_a_snapshot_that_no_run_tells_is_refused(path, value):
    with pytest.raises(ValueError, match=REFUSED):
        read_snapshot(spoilt(SNAPSHOT, f"snapshot.{path}", value))


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
    with pytest.raises(ValueError, match=REFUSED):
        unpack_judgement(zlib.compress(spoilt(JUDGEMENT, path, value)))


def test_a_judgement_that_is_too_long_says_so():
    many = replace(JUDGEMENT, verdicts=JUDGEMENT.verdicts * 9000)
    told = unpack_judgement(pack_judgement(many))
    assert (told.run, told.time, told.signals, told.verdicts) == ("c.0", 2.0, (), ())
    assert told.log[-1].text.startswith("9000 verdicts and their signals are too long")
