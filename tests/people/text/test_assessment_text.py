"""What is said of cells and campaigns whose runs have not all finished."""

from dataclasses import replace
from itertools import product
from typing import get_args

import pytest

from daemon.analysis.results import CampaignResults
from daemon.judging.assessment import assess
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    ExpectedVerdict,
    RepeatPolicy,
    group_errors,
)
from daemon.model.status import RunDetail
from daemon.model.verdicts import Evidence, Outcome, RunState, Verdict
from scenario_tui.text.assessment_text import cell_notes, undecided_text
from scenario_tui.text.results import (
    NONE_JUDGED,
    SO_FAR_FINE,
    Conclusion,
    conclude,
    worst_conclusion,
)
from scenario_tui.text.run_text import run_text
from tests.make import campaign_row, run_result, run_row
from tests.people.fake import make_row, make_spec


def record(repeat, state, outcome=None):
    result = outcome and run_result(Verdict("buffer", "", outcome, 0.1, 0.1, "m"), outcome=outcome)
    return run_row(f"c.{repeat}", repeat=repeat, result=result, state=RunState(state))


def judged(*records, expected="pass", finished=True, **policy):
    rules = AssessmentRules(
        RepeatPolicy(n=len(records), **policy),
        expectations=(Expectation("S1", "buffer", (), expected, "it is narrow"),),
    )
    row = campaign_row("first-1", queued=0 if finished else 1)
    return CampaignResults(row, records, rules, assess(rules, records))


CELLS = ("pass queued", "pass running", "fail queued", "queued queued",
         "running queued", "running running", "queued running lost", "pass cancelled",
         "cancelled cancelled", "lost lost", "lost queued", "inconclusive")  # fmt: skip
"""What became of the runs of a cell, one word for each."""
STATES = {str(one): ("done", one) for one in (Outcome.PASS, Outcome.FAIL, Outcome.INCONCLUSIVE)}


def test_cells_and_campaigns_are_told_by_what_was_judged(golden):
    said = {}
    for words in CELLS:
        words_of = enumerate(words.split())
        runs = [record(i, *STATES.get(word, (word,))) for i, word in words_of]
        finished = not {"queued", "running"} & {*words.split()}
        for expected, rule in product(get_args(ExpectedVerdict), ("all", "rate", "mean")):
            results = judged(*runs, expected=expected, rule=rule, finished=finished)
            (cell,) = results.assessment.cells
            notes = cell_notes(cell, results.expectations).plain
            told = f"{cell.word}, {cell.state}; {conclude(results).glyph_text}\n{notes.rstrip()}"
            said.setdefault((words, told), []).append(f"{expected} by {rule}")
    parts = (f"# {words}: {', '.join(by)}\n{told}\n" for (words, told), by in said.items())
    golden("assessment.txt", "\n".join(parts))


def test_a_conclusion_counts_verdicts_and_known_failures():
    runs = (record(0, "done", Outcome.FAIL), record(1, "lost"))
    known = conclude(judged(*runs, expected="mixed"))
    assert (known.verdicts, known.known, known.unexpected) == (1, 1, 0)
    assert (known.margins, known.expectations.mark(runs[0]).letter) == ((0.1,), "a")


NEWS, FINE = Conclusion("fail", "2 unexpected", 2), Conclusion("pass", "as expected")
CANCELLED, WAITING = Conclusion("cancelled", "cancelled"), Conclusion("queued", NONE_JUDGED)


@pytest.mark.parametrize(
    ("conclusions", "worst"),
    [
        ((CANCELLED, NEWS), NEWS),
        ((FINE, NEWS, Conclusion("fail", "1 unexpected", 1)), NEWS),
        ((CANCELLED, FINE), FINE),
        ((CANCELLED,), CANCELLED),
        ((WAITING, FINE), Conclusion("running", SO_FAR_FINE)),
        ((WAITING,), WAITING),
        ((), None),
    ],
)
def test_the_worst_state_is_that_of_any_campaign(conclusions, worst):
    rows = [campaign_row(f"doors-{i}") for i in range(len(conclusions))]
    told = worst_conclusion(rows, {f"doors-{i}": one for i, one in enumerate(conclusions)})
    assert (told and told[1]) == worst


def test_neither_acknowledged_campaigns_nor_searches_are_told():
    row = campaign_row("doors-1")
    for quiet in (replace(row, acknowledged=True), replace(row, search="finished")):
        assert worst_conclusion([quiet], {"doors-1": NEWS}) is None


def test_an_error_is_told_once_and_not_for_each_oracle():
    error = Evidence(note="amcl died with exit code -9\nthe stack printed:\n  [ERROR] bye")
    verdicts = (
        Verdict("reached", "", Outcome.ERROR, None, None, "m", error),
        Verdict("in-time", "", Outcome.PASS, 0.1, 0.1, "s"),
        Verdict("buffer", "", Outcome.ERROR, None, None, "m", error),
    )
    row = run_row(result=run_result(*verdicts, outcome=Outcome.ERROR))
    (cell,) = assess(AssessmentRules(), (row,)).cells
    alone, together = sorted(group_errors(cell.oracles), key=len)
    assert [oracle.oracle for oracle in alone] == ["in-time"]
    said = undecided_text(together).plain
    assert "pilot S1 reached, buffer  " in said
    assert said.endswith("  amcl died with exit code -9")


def test_a_run_that_was_lost_for_no_reason_says_so():
    row = replace(make_row(0), state=RunState.LOST, outcome=None)
    said = run_text(RunDetail(row, make_spec(row, "0" * 64)), None).plain
    assert "no attempt left a result" in said
