"""Runs in processes of their own: what becomes of those that do not end well."""

import dataclasses
import os
import random
import signal
import time
from contextlib import suppress

import numpy as np
import pytest

from daemon.analysis.blame import BudgetSpentError, Candidate, CandidateRunner, execute_candidates
from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome
from daemon.run import execute
from tests.analysis.blame.cases import CAMPAIGN, failing_if, pretend, write


@pytest.fixture
def candidate(folder):
    planned = expand(load_campaign(write(folder, CAMPAIGN.replace("16 s", "1 s"))))
    return Candidate(planned.specs[0], planned.scenes[0])


def numbered(candidate, count):
    return [
        Candidate(dataclasses.replace(candidate.spec, seed=seed), candidate.scene)
        for seed in range(count)
    ]


def test_verdicts_come_back_and_a_process_that_dies_is_unresolved(candidate):
    doomed = dataclasses.replace(candidate.spec, seed=1)

    def execute_or_die(spec, scene, **rest):
        if spec.seed == 1:
            os._exit(3)
        return execute(spec, scene, **rest)

    pair = [candidate, Candidate(doomed, candidate.scene)]
    good, bad = execute_candidates(pair, execute_or_die)
    assert [one.word for one in good] == ["fail", "pass"]
    assert [one.verdict.oracle for one in good] == ["reached", "no-contact"]
    assert {one.word for one in bad} == {"unresolved"}
    assert bad[0].verdict.evidence.note == "its process died with code 3"


def test_a_system_that_prints_by_descriptors_prints_into_no_answer(candidate, capfd):
    def execute_aloud(spec, scene, **rest):
        print("by Python")
        os.system("echo by a child; echo by a child >&2")
        os.write(1, b"by descriptor\n")
        os.write(2, b"by descriptor\n")
        return execute(spec, scene, **rest)

    (endings,) = execute_candidates([candidate], execute_aloud)
    assert [one.word for one in endings] == ["fail", "pass"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("draw", [random.random, np.random.random], ids=["random", "numpy"])
def test_chance_that_nobody_has_seeded_differs_between_candidates(candidate, draw, tmp_path):
    def execute_by_chance(spec, scene, **rest):
        (tmp_path / f"{spec.seed}.txt").write_text(str(draw()))
        return execute(spec, scene, **rest)

    execute_candidates(numbered(candidate, 2), execute_by_chance)
    assert len({(tmp_path / f"{seed}.txt").read_text() for seed in range(2)}) == 2


def test_an_interrupt_leaves_no_process_behind(candidate, tmp_path):
    parent = os.getpid()

    def interrupt_together(*_, **__):
        (tmp_path / str(os.getpid())).touch()
        if len(list(tmp_path.glob("[0-9]*"))) == 2:
            # Both may see both: one interrupt is what is tried.
            with suppress(FileExistsError):
                (tmp_path / "interrupted").touch(exist_ok=False)
                os.kill(parent, signal.SIGINT)
        time.sleep(60.0)

    with pytest.raises(KeyboardInterrupt):
        execute_candidates(numbered(candidate, 2), interrupt_together)
    for name in tmp_path.glob("[0-9]*"):
        with pytest.raises(ProcessLookupError):
            os.kill(int(name.name), 0)


def test_candidates_run_in_batches_up_to_the_first_that_fails(candidate, monkeypatch):
    pretended = pretend(monkeypatch, failing_if(lambda spec: spec.seed == 2))
    single = dataclasses.replace(candidate.spec, oracles=candidate.spec.oracles[:1])
    tried = numbered(Candidate(single, candidate.scene), 6)
    runner = CandidateRunner(4)
    assert runner.first_failing([None, *tried[:2]]) is None
    assert runner.first_failing(tried) == 2
    assert [spec.seed for spec in pretended.specs] == [0, 1, 2, 3], "the batch of the failing one"
    assert (runner.runs, runner.cached) == (4, 2)
    known = runner.known(tried[2])
    assert known is not None
    assert known.verdict.outcome is Outcome.FAIL
    with pytest.raises(BudgetSpentError):
        runner.first_failing(tried[4:])
