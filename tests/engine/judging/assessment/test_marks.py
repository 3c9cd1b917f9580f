"""Marks beside cells and runs: news with ``!``, known failures with a letter."""

import pytest

from daemon.judging.assessment import assess, find_marks
from daemon.model.assessments import AssessmentRules, Expectation, Mark, RepeatPolicy
from tests.engine.judging.assessment.records import cell, record, verdict

KNOWN = Mark("known", "a", "it is narrow")


def marks_of(runs, wanted="pass", policy="all"):
    """The marks of the cell and of each of its runs."""
    declared = AssessmentRules(
        RepeatPolicy(len(runs), policy, 0.5),
        expectations=(Expectation("S1", "clear", (), wanted, "it is narrow"),),
    )
    assessment = assess(declared, runs)
    found = find_marks(declared, assessment, runs)
    return found.mark_cells(assessment.cells[:1]), [found.mark(run) for run in runs]


def test_a_failure_that_nobody_expected_is_news():
    whole, (passing, failing) = marks_of(cell([0.1, -0.1]))
    assert (whole.kind, whole.letter, whole.reason) == ("news", "!", "expected pass")
    assert (passing, failing) == (Mark(), whole)


@pytest.mark.parametrize("wanted", ["fail", "mixed", "any"])
def test_a_known_failure_has_the_letter_of_its_reason(wanted):
    assert marks_of(cell([-0.1, -0.2]), wanted) == (KNOWN, [KNOWN, KNOWN])


def test_a_reason_stands_only_beside_what_it_concerns():
    assert marks_of(cell([0.1, 0.1]), "any") == (Mark(), [Mark(), Mark()])


def test_what_passes_although_it_should_fail_is_news():
    whole, (known, news) = marks_of(cell([-0.1, 0.1]), "fail")
    assert (whole.kind, known, news.kind) == ("news", KNOWN, "news")


def test_failures_within_the_rate_are_not_news():
    assert marks_of(cell([0.1] * 20 + [-0.1]), policy="rate")[1][-1] == Mark()
    assert marks_of(cell([-0.1] * 20), policy="rate")[1][0].kind == "news"


def test_one_failure_that_is_not_known_makes_the_run_news():
    run = record(0, verdict(-0.1), verdict(-0.1, oracle="reached"))
    whole, (mark,) = marks_of([run], "fail")
    assert mark == whole == Mark("news", "!a", "expected pass")
