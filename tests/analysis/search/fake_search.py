"""A stand-in for the program of a search, and for its runs: they cost nothing.

Every value depends on what was learnt before, so that nothing that is learnt otherwise goes
unnoticed. A client of such a search that can be killed is
``python -m tests.analysis.search.fake_search ENDPOINT CAMPAIGN RUNS``.
"""

import hashlib
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from daemon.model.search import Proposal
from daemon.model.search_answer import SearchAnswer
from daemon.model.spec import LeadingMargin, RunSpec, TraceInfo
from daemon.model.verdicts import Outcome
from grammars.model.scene import Scene
from tests.make import SCENE, make_result, make_search, make_spec

CONFIRMED = 2


@dataclass(frozen=True, slots=True)
class FakeCandidate:
    """As the real one, without all that runs and judges, which each process would load."""

    spec: RunSpec
    scene: Scene


def search(task, runs, learnt="", **parameters):
    """Propose ``task.runs`` points in the window and repeat the first one.

    ``learnt`` before makes it another search; ``parameters`` are those of its runs.
    """
    for number in range(task.runs):
        if number >= task.window:
            learnt = learn(learnt, runs.result(number - task.window))
            runs.report("explore", f"{number} proposed", answer_of(number))
        issue(task, runs, number, number, 0, learnt, parameters)
    for number in range(max(0, task.runs - task.window), task.runs):
        learnt = learn(learnt, runs.result(number))
    for repeat in range(1, CONFIRMED + 1):
        issue(task, runs, task.runs + repeat - 1, 0, repeat, "", parameters, "confirm")
    for repeat in range(CONFIRMED):
        runs.result(task.runs + repeat)
    return replace(answer_of(task.runs), ended="budget")


def client_of(daemon, campaign, runs, program=search, name="lab", **parameters):
    """Begin a search at a daemon, and return its client, which is not started."""
    # Not for each process that executes runs.
    from daemon.batch.client import Client
    from daemon.search.client import SearchClient

    begun, client = make_search(campaign, name, runs=runs), Client.open(daemon, timeout=30.0)
    client.begin_search(begun)
    return SearchClient(client, begun, partial(program, begun.task, **parameters))


def answer_of(explored):
    return SearchAnswer("", explored, explored, 0, 0, 0, 0, 0, 0, sentences=("so far",))


def learn(learnt, row):
    margin = row.leads[0].margin if row.leads else None
    return hashlib.sha256(f"{learnt} {margin}".encode()).hexdigest()


def issue(task, runs, position, number, repeat, learnt, parameters, phase="explore"):
    drawn = hashlib.sha256(f"{number} {learnt}".encode()).digest()
    value = round(40.0 + 40.0 * drawn[0] / 255.0, 1)
    spec = make_spec(repeat, scenario=task.scenario_of(number), value=value, **parameters)
    proposal = Proposal(position, number, repeat, phase, "hash", bool(learnt), (value,))
    runs.issue(proposal, FakeCandidate(spec, SCENE))


def result_of(spec, *, leads):
    margin = (spec.sut.parameters["value"] - 50.0) / 10.0 + spec.repeat
    outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
    result = make_result(spec, outcome=outcome, margin=margin)
    return replace(result, leads=(LeadingMargin("arrives", margin, "s"),) if leads else ())


def execute(spec, scene, *, trace_path, on_progress=None, interest=None, leads=False):
    """Execute a run: ``until`` there is this file, if its parameters name one."""
    gate = spec.sut.parameters.get("until", "")
    while gate and not Path(gate).exists():
        time.sleep(0.01)
    data = spec.digest.encode()
    trace_path.write_bytes(data)
    trace = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), 1)
    return replace(result_of(spec, leads=leads), trace=trace)


if __name__ == "__main__":
    endpoint, campaign, runs = sys.argv[1:]
    client_of(endpoint, campaign, int(runs)).run()
