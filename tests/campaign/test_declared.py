"""What campaign files say about their results, and what is reported about how they say it."""

import shutil

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    ReferenceValue,
    RegressionGate,
    RepeatPolicy,
    ScenarioComparison,
)

CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: {n: 2, pass: rate >= 80 %, until: decided, at-most: 5}
limit: 30 s
robot: courier
oracles: navigation
matrix: {sut: [pilot, idle]}
scenarios:
  base:
    abstract: true
    floorplan: flat
    objects: doors
    behaviours: doors_open
    mission: courier
    oracles: [reached, nearest]
  calm.1: {like: base}
  rude.1:
    like: base
    behaviours: doors_in_your_face
    oracles+: [no-contact]
compare:
  slower: delay(rude.1 vs calm.1) <= 0.5 min
  kitchen: delay( rude.1 vs calm.1 on leg kitchen ) < 10 s
  closer: nearest(rude.1 vs calm.1) >= -20 cm
expect:
  - {scenario: rude.*, oracle: reached, verdict: fail, why: "doors shut", sut: pilot}
  - {oracle: slower, verdict: any, why: "nobody knows"}
gate: {baseline: last-green, worse-by: 10 %}
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    return tmp_path / "demo"


def load(folder, text):
    path = folder / "tiny.yaml"
    path.write_text(text)
    return load_campaign(path)


def test_sentences_become_values(folder):
    declared = load(folder, CAMPAIGN).declared
    assert declared == AssessmentRules(
        RepeatPolicy(2, "rate", 0.8, until_decided=True, at_most=5),
        (
            ScenarioComparison("slower", "delay", "rude.1", "calm.1", None, "<=", 30.0, "s",
                       "delay(rude.1 vs calm.1) <= 0.5 min"),
            ScenarioComparison("kitchen", "delay", "rude.1", "calm.1", "kitchen", "<", 10.0, "s",
                       "delay( rude.1 vs calm.1 on leg kitchen ) < 10 s",
                       "elapsed-on-leg-kitchen"),
            ScenarioComparison("closer", "nearest", "rude.1", "calm.1", None, ">=", -0.2, "m",
                       "nearest(rude.1 vs calm.1) >= -20 cm"),
        ),
        (
            Expectation("rude.*", "reached", ("pilot",), "fail", "doors shut", "tiny.yaml:26"),
            Expectation("*", "slower", (), "any", "nobody knows", "tiny.yaml:27"),
        ),
        RegressionGate("last-green", 0.1),
    )  # fmt: skip


def test_a_plain_number_of_repeats_is_what_it_was(folder):
    plain = load(
        folder, CAMPAIGN.replace("{n: 2, pass: rate >= 80 %, until: decided, at-most: 5}", "2")
    )
    assert plain.declared.policy == RepeatPolicy(2, "all", 1.0, until_decided=False, at_most=2)
    assert expand(plain).reserve == ()


def test_repeats_in_reserve_continue_those_that_run(folder):
    patient = expand(load(folder, CAMPAIGN))
    longer = expand(load(folder, CAMPAIGN.replace(
        "{n: 2, pass: rate >= 80 %, until: decided, at-most: 5}", "5"
    )))  # fmt: skip
    assert [r.repeat for r in patient.specs] == [0, 1] * 4
    assert [r.repeat for r in patient.reserve] == [2, 3, 4] * 4
    digests = {patient.spec(run).digest for run in (*patient.runs, *patient.reserve)}
    assert digests == set(longer.digests)


def test_a_leg_that_is_compared_is_timed_in_both_scenarios(folder):
    for run in expand(load(folder, CAMPAIGN)).specs:
        timed = [o.text for o in run.oracles if o.name == "elapsed-on-leg-kitchen"]
        assert timed == ["max(mission.leg.elapsed) on leg kitchen"]


def test_any_change_of_what_is_declared_is_another_campaign(folder):
    first = expand(load(folder, CAMPAIGN))
    other = expand(load(folder, CAMPAIGN.replace("nobody knows", "somebody knows")))
    assert first.campaign != other.campaign
    assert first.digests == other.digests


REFERENCE = """\
reference:
  earlier:
    source: "The same robot, last year"
    values:
      - {scenario: rude.1, sut: pilot, oracle: duration, value: 0.5 min, deviation: 2 s, runs: 4}
      - {scenario: "*", oracle: nearest, value: 5 cm, statistic: min, range: [4 cm, 6 cm], note: n}
      - {scenario: calm.1, oracle: reached, value: 3 of 5}
      - {oracle: slower, sut: pilot, value: -8.9 s}
"""


def test_reference_values_are_in_si_and_keep_their_words(folder):
    def value(scenario, suts, oracle, **more):
        return ReferenceValue(
            "earlier", "The same robot, last year", scenario, suts, oracle, **more
        )

    assert load(folder, CAMPAIGN + REFERENCE).declared.references == (
        value("rude.1", ("pilot",), "duration", statistic="mean", value=30.0, unit="s",
              text="0.5 min ± 2 s", deviation=2.0, runs=4, where="tiny.yaml:33"),
        value("*", (), "nearest", statistic="min", value=0.05, unit="m",
              text="5 cm (4 cm to 6 cm)", low=0.04, high=0.06, note="n", where="tiny.yaml:34"),
        value("calm.1", (), "reached", statistic="rate", value=0.6, unit="1", text="3 of 5",
              runs=5, where="tiny.yaml:35"),
        value("", ("pilot",), "slower", statistic="mean", value=-8.9, unit="s", text="-8.9 s",
              where="tiny.yaml:36"),
    )  # fmt: skip


def test_a_reference_value_changes_no_run(folder):
    plain, told = (expand(load(folder, text)) for text in (CAMPAIGN, CAMPAIGN + REFERENCE))
    assert plain.digests == told.digests
