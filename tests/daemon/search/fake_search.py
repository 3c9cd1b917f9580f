"""A stand-in for the program of a search, and for its runs: they cost nothing.

Every value depends on what was learnt before, so that nothing that is learnt otherwise goes
unnoticed. The campaign file says what else happens: ``raise`` and ``refuse`` with words, ``die``,
``count`` (proposes other values in each life), ``answer`` (bytes of its files).
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

from daemon.model.proposals import Proposal, ProposalRow
from daemon.model.search import BundledFile
from daemon.model.search_answer import SearchAnswer, ShrunkScenario
from daemon.model.spec import LeadingMargin, RunSpec, TraceInfo
from daemon.model.verdicts import Outcome
from grammars.model.scene import Scene
from grammars.text.diagnostics import InputError, Where
from tests.daemon.batch.samples import SCENE, make_result, make_spec
from tests.run_rows import run_row

if TYPE_CHECKING:
    from daemon.analysis.blame import Candidate

CONFIRMED = 2


@dataclass(frozen=True, slots=True)
class FakeCandidate:
    """As the real one, without all that runs and judges, which each process would load."""

    spec: RunSpec
    scene: Scene


def search(folder, name, task, runs):
    """Propose ``task.runs`` points in the window and repeat the first one."""
    file = folder / name
    asked = json.loads(file.read_text())
    if "raise" in asked:
        raise RuntimeError(asked["raise"])
    if "refuse" in asked:
        raise InputError.at(Where(str(file), 3), asked["refuse"])
    lives = file.with_name("lives")
    lives.write_text(f"{int(lives.read_text()) + 1}" if lives.exists() else "0")
    learnt = lives.read_text() if "count" in asked else ""
    for number in range(task.runs):
        if number >= task.window:
            learnt = learn(learnt, runs.result(number - task.window))
            runs.report("explore", f"{number} proposed", answer_of(task, number))
        if number == asked.get("die"):
            os.kill(os.getpid(), signal.SIGKILL)
        issue(task, runs, number, number, 0, learnt, asked)
    for number in range(max(0, task.runs - task.window), task.runs):
        learnt = learn(learnt, runs.result(number))
    for repeat in range(1, CONFIRMED + 1):
        issue(task, runs, task.runs + repeat - 1, 0, repeat, "", asked, "confirm")
    for repeat in range(CONFIRMED):
        runs.result(task.runs + repeat)
    files = (BundledFile("campaign.yaml", "x" * asked.get("answer", 0)),)
    shrunk = ShrunkScenario(("a line",), True, 0, files)
    return replace(answer_of(task, task.runs), ended="budget", shrunk=shrunk)


def idle(folder, name, task, runs):
    """Propose nothing, for as long as the process lasts."""
    threading.Event().wait()
    raise AssertionError


def answer_of(task, explored):
    return SearchAnswer("", explored, explored, 0, 0, 0, 0, 0, 0, None, sentences=("so far",))


def learn(learnt, row):
    margin = row.run.leads[0].margin if row.run.leads else None
    return hashlib.sha256(f"{learnt} {margin}".encode()).hexdigest()


def issue(task, runs, position, number, repeat, learnt, asked, phase="explore"):
    drawn = hashlib.sha256(f"{number} {learnt}".encode()).digest()
    value = round(40.0 + 40.0 * drawn[0] / 255.0, 1)
    parameters = asked.get("parameters", {})
    assert isinstance(parameters, dict)
    spec = make_spec(repeat, scenario=task.scenario_of(number), value=value, **parameters)
    proposal = Proposal(position, number, repeat, phase, "hash", bool(learnt), (value,))
    runs.issue(proposal, cast("Candidate", FakeCandidate(spec, SCENE)))


class LocalRuns:
    """Executes runs at once, in this process: what every other way must agree with."""

    def __init__(self, make=None):
        self._make = make or (lambda spec: result_of(spec, leads=True))
        self.digests = []
        self._rows = []

    def issue(self, proposal, candidate):
        spec = candidate.spec
        self.digests.append((proposal.position, spec.digest))
        result = self._make(spec)
        self._rows.append(ProposalRow(proposal, run_row(digest=spec.digest, result=result)))

    def issued(self, position):
        return None

    def result(self, position):
        return self._rows[position]

    def report(self, phase, note, answer):
        """Nobody listens."""

    def elapsed(self):
        return 0.0


def result_of(spec, *, leads):
    margin = (spec.sut.parameters["value"] - 50.0) / 10.0 + spec.repeat
    outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
    result = make_result(spec, outcome=outcome, margin=margin)
    lead = LeadingMargin("arrives", margin, "s")
    return replace(result, leads=(lead,) if leads else ())


def execute(spec, scene, *, trace_path, on_progress=None, interest=None, leads=False):
    """Execute a run: ``until`` there is this file, if its parameters name one."""
    gate = spec.sut.parameters.get("until", "")
    while gate and not Path(gate).exists():
        time.sleep(0.01)
    data = spec.digest.encode()
    trace_path.write_bytes(data)
    trace = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), 1)
    return replace(result_of(spec, leads=leads), trace=trace)
