"""Words of campaign files about their results: repeats, comparisons, expectations, references."""

import json

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.assessments import RepeatPolicy
from grammars.text import codec

PATIENT = {"n": 2, "pass": "rate >= 80 %", "until": "decided", "at-most": 5}
COMPARE = {
    "slower": "delay(rude.1 vs calm.1) <= 0.5 min",
    "kitchen": "delay( rude.1 vs calm.1 on leg kitchen ) < 10 s",
    "closer": "nearest(rude.1 vs calm.1) >= -20 cm",
}
EXPECT = [
    {"scenario": "rude.*", "oracle": "reached", "verdict": "fail", "why": "shut", "sut": "pilot"},
    {"oracle": "slower", "verdict": "any", "why": "nobody knows"},
]
VALUES = [
    {"scenario": "rude.1", "sut": "pilot", "oracle": "duration", "value": "0.5 min",
     "deviation": "2 s", "runs": 4},
    {"scenario": "*", "oracle": "nearest", "value": "5 cm", "statistic": "min",
     "range": ["4 cm", "6 cm"], "note": "n"},
    {"scenario": "calm.1", "oracle": "reached", "value": "3 of 5"},
    {"oracle": "slower", "sut": "pilot", "value": "-8.9 s"},
]  # fmt: skip
SOURCE = "The same robot, last year"


@pytest.fixture
def declared(campaign):
    """Write a campaign of two scenarios that are compared."""
    oracles = {"like": "calm", "oracles": ["reached", "nearest"]}
    rude = {"like": "calm.1", "behaviours": "doors_in_your_face", "oracles+": ["no-contact"]}

    def load(repeats=PATIENT, expect=EXPECT, **more):
        more |= {"repeats": repeats, "expect": expect, "compare": COMPARE}
        more |= {"gate": {"baseline": "last-green", "worse-by": "10 %"}}
        scenarios = {"calm.1": oracles, "rude.1": rude}
        return load_campaign(
            campaign(scenarios=scenarios, matrix={"sut": ["pilot", "idle"]}, **more)
        )

    return load


def test_sentences_become_values(declared, golden):
    campaign = declared(reference={"earlier": {"source": SOURCE, "values": VALUES}})
    rules = json.dumps(codec.to_plain(campaign.declared), indent=1, ensure_ascii=False)
    lines = "".join(f"{n:3} {line}\n" for n, line in enumerate(campaign.source.splitlines(), 1))
    golden("declared.txt", f"{lines}\n{rules}\n")


def test_a_plain_number_of_repeats_has_nothing_in_reserve(declared):
    plain = declared(repeats=2)
    assert plain.declared.policy == RepeatPolicy(2, "all", 1.0, until_decided=False, at_most=2)
    assert expand(plain).reserve == ()


def test_repeats_in_reserve_continue_those_that_run(declared):
    patient, longer = expand(declared()), expand(declared(repeats=5))
    cells = len(patient.specs) // 2
    assert [r.repeat for r in patient.specs] == [0, 1] * cells
    assert [r.repeat for r in patient.reserve] == [2, 3, 4] * cells
    digests = {patient.spec(run).digest for run in (*patient.runs, *patient.reserve)}
    assert digests == set(longer.digests)


def test_a_leg_that_is_compared_is_timed_in_both_scenarios(declared):
    timed = {run.scenario: [o.text for o in run.oracles if o.name == "elapsed-on-leg-kitchen"]
             for run in expand(declared()).specs}  # fmt: skip
    leg = ["max(mission.leg.elapsed) on leg kitchen"]
    assert timed == {"calm": [], "calm.1": leg, "rude.1": leg}


def test_any_change_of_a_declaration_is_another_campaign_of_the_same_runs(declared):
    first = expand(declared())
    for other in (
        expand(declared(expect=[EXPECT[0], EXPECT[1] | {"why": "somebody knows"}])),
        expand(declared(reference={"earlier": {"source": SOURCE, "values": VALUES}})),
    ):
        assert first.campaign != other.campaign
        assert first.digests == other.digests
