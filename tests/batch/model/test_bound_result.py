"""Results are bounded: evidence goes first, then verdicts, the outcome never."""

from dataclasses import replace

from daemon.model.spec import LARGEST_RESULT, LeadingMargin, RunResult, bound_result
from daemon.model.verdicts import Evidence, Outcome
from grammars.text import codec
from tests.make import make_result, make_spec

RESULT = make_result(make_spec(), outcome=Outcome.FAIL)


def test_a_usual_result_is_as_it_was():
    many = replace(RESULT, verdicts=RESULT.verdicts * 500, note="\N{GRINNING FACE}" * 1000)
    assert bound_result(RESULT) is RESULT
    assert bound_result(many) is many


def test_long_evidence_is_cut_and_verdicts_stay():
    evidence = Evidence(time=3.0, value=0.1, object="door " * 1000, note="\x01" * LARGEST_RESULT)
    verdict = replace(RESULT.verdicts[0], evidence=evidence)
    bound = bound_result(replace(RESULT, verdicts=(verdict,) * 3, note="y" * LARGEST_RESULT))
    assert len(codec.to_json(bound)) <= LARGEST_RESULT
    assert bound.outcome is Outcome.FAIL
    assert [v.evidence.value for v in bound.verdicts] == [0.1] * 3
    assert "notes were cut" in bound.note
    assert bound_result(bound) is bound


def test_too_many_verdicts_are_left_out_and_counted():
    bound = bound_result(replace(RESULT, verdicts=RESULT.verdicts * 5000))
    assert len(codec.to_json(bound)) <= LARGEST_RESULT
    assert (bound.outcome, bound.verdicts) == (Outcome.FAIL, ())
    assert "5000 verdicts were left out" in bound.note


def test_leading_margins_survive_what_is_cut():
    leads = (
        LeadingMargin("clear", -0.01, "m", "door " * 1000, "w3"),
        LeadingMargin("calm", None, ""),
    )
    led = replace(RESULT, leads=leads)
    assert bound_result(led) is led
    for much in (
        replace(led, note="y" * LARGEST_RESULT),
        replace(led, verdicts=RESULT.verdicts * 5000),
    ):
        bound = bound_result(much)
        assert len(codec.to_json(bound)) <= LARGEST_RESULT
        assert [(lead.oracle, lead.margin) for lead in bound.leads] == [
            ("clear", -0.01),
            ("calm", None),
        ]
        assert codec.from_json(RunResult, codec.to_json(bound)) == bound
    many = replace(led, verdicts=RESULT.verdicts * 5000, leads=leads * 5000)
    assert len(codec.to_json(bound_result(many))) <= LARGEST_RESULT


def test_what_was_stored_before_there_were_leading_margins_still_reads():
    old = codec.to_json(RESULT).replace(b',"leads":[]', b"")
    assert b"leads" not in old
    assert codec.from_json(RunResult, old) == RESULT
    led = replace(RESULT, leads=(LeadingMargin("clear", -0.01, "m"),))
    assert led.digest == RESULT.digest
