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
from grammars.text.diagnostics import InputError

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


def complaints(folder, old, new):
    assert old in CAMPAIGN
    with pytest.raises(InputError) as caught:
        load(folder, CAMPAIGN.replace(old, new, 1))
    return [str(d).replace(f"{folder}/", "") for d in caught.value.diagnostics]


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


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("(rude.1 vs calm.1) <=", "(rude.1 vs calm.2) <=",
         ['tiny.yaml:22:27: no scenario "calm.2" here', 'did you mean "calm.1"?']),
        (": delay(rude.1 vs calm.1) <=", ": >\n   delay(calm.1\n   vs calm.2) <=",
         ['tiny.yaml:22: no scenario "calm.2" here']),
        ("(rude.1 vs calm.1) <=", "(base vs calm.1) <=", ["tiny.yaml:22:17", "is abstract"]),
        ("(rude.1 vs calm.1) <=", "(calm.1 vs calm.1) <=", ["compared with itself"]),
        ("(rude.1 vs calm.1) <=", "(rude.1, calm.1) <=",
         ["tiny.yaml:22:11", "is not a comparison", "delay(S3.2 vs S3.5) <= 30 s"]),
        ("<= 0.5 min", "<= 0.5 m", ["tiny.yaml:22:38", '"0.5 m" is in m, delay is in s']),
        ("<= 0.5 min", "<= 30", ['"30" has no unit, delay is in s']),
        ("<= 0.5 min", "<= soon", ["tiny.yaml:22:38", '"soon"']),
        ("nearest(rude.1", "neerest(rude.1", ['no measure "neerest"', '"nearest"?']),
        ("nearest(rude.1", "reached(rude.1", ['"reached" has a limit', "delay, "]),
        ("[reached, nearest]", "[reached]",
         ['"rude.1" does not measure nearest', "add it to the oracles of rude.1"]),
        ("on leg kitchen", "on leg kitschen", ['no waypoint "kitschen"', '"kitchen"?']),
        ("nearest(rude.1 vs calm.1)", "nearest(rude.1 vs calm.1 on leg kitchen)",
         ['"on leg" goes with delay']),
        ("scenario: rude.*", "scenario: rode.*", ["tiny.yaml:26", 'no scenario "rode.*"']),
        ("scenario: rude.*, oracle: reached", "scenario: calm.1, oracle: no-contact",
         ["tiny.yaml:26", 'no oracle "no-contact" judges calm.1']),
        ("oracle: reached", "oracle: nearest", ['"nearest" is a measure, it has no verdict']),
        ("oracle: reached", "oracle: reeched", ['"reached"?']),
        ("sut: pilot}", "sut: [pilot, pylot]}", ['no system under test "pylot"', '"pilot"?']),
        (', why: "doors shut"', "", ['tiny.yaml:26', 'key "why" is missing']),
        ("verdict: fail", "verdict: red", ["verdict: must be 'pass', 'fail', 'mixed' or 'any'"]),
        ("oracle: slower, ", "", ["tiny.yaml:27", 'name a "scenario" or an "oracle"']),
        ("{n: 2, pass: rate >= 80 %, until: decided, at-most: 5}", "{n: 2, pass: often}",
         ["tiny.yaml:3:17", '"often" is not a rule', "rate >= 80 %"]),
        ("rate >= 80 %", "rate >= 100 %", ["no number of runs shows a rate of 100 %"]),
        ("rate >= 80 %", "all", ['"until: decided" needs']),
        (", at-most: 5", "", ["need each other"]),
        ("at-most: 5", "at-most: 2", ["leaves nothing to add"]),
        ("at-most", "at_most", ['unknown key "at_most"', '"at-most"?']),
        ("{n: 2, pass: rate >= 80 %, until: decided, at-most: 5}", "many",
         ["tiny.yaml:3:1: repeats: must be a whole number, or {n: 5, pass: rate >= 80 %}"]),
        ("worse-by: 10 %", "worse-by: 10 s", ["tiny.yaml:28", '"10 s" is in s']),
        ("rate >= 80 %", ">= 80 %", ["tiny.yaml:3"]),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_reported_where_it_stands(folder, old, new, expected):
    found = "\n".join(complaints(folder, old, new))
    for part in expected:
        assert part in found


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("seed: 4", ["tiny.yaml:29:1: the same key is written twice"]),
        ("on: night", ['tiny.yaml:29:1: unknown key "on"']),
        ("compare: {3.10: delay(calm.1 vs rude.1) < 1 s}", ["the same key is written twice"]),
    ],
)
def test_traps_of_yaml_have_a_message_each(folder, line, expected):
    with pytest.raises(InputError) as caught:
        load(folder, f"{CAMPAIGN}{line}\n")
    found = str(caught.value).replace(f"{folder}/", "")
    assert all(part in found for part in expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("calm.1: {like", "3.10: {like", ["16:3: key 3.10 is a number", '"3.10"']),
        (
            "{like: base}",
            "{like: 3.10}",
            ["like: must be text", "3.10 is a number", 'write it as "3.10"'],
        ),
        ("[pilot, idle]", "[pilot, true]", ["sut: must be text", 'write it as "true"']),
    ],
)
def test_numbers_and_flags_that_mean_text_are_told_how_to(folder, old, new, expected):
    found = "\n".join(complaints(folder, old, new))
    for part in expected:
        assert part in found


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


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("scenario: rude.1, sut", "scenario: rude.2, sut",
         ['tiny.yaml:33', 'no scenario "rude.2"', '"rude.1"?']),
        ("sut: pilot, oracle", "sut: pylot, oracle", ['no system under test "pylot"', '"pilot"?']),
        ("oracle: duration", "oracle: durration", ['neither measure nor oracle', '"duration"?']),
        ("0.5 min", "0.5 m", ['tiny.yaml:33', '"0.5 m" is in m, duration is in s']),
        ("0.5 min", "30", ['"30" has no unit, duration is in s']),
        ("deviation: 2 s", "deviation: -2 s", ["a deviation is never negative"]),
        ("[4 cm, 6 cm]", "[6 cm, 4 cm]", ["tiny.yaml:34", "write the smaller value first"]),
        ("[4 cm, 6 cm]", "[4 cm]", ["range: must have 2 or more"]),
        ("3 of 5", "60 %", ["tiny.yaml:35", '"60 %" does not say how many runs passed', "3 of 5"]),
        ("3 of 5", "6 of 5", ["does not say how many runs passed"]),
        ("3 of 5", "3 of 5, runs: 5", ['"runs" goes with a measure']),
        ("oracle: slower", "oracle: slow", ['tiny.yaml:36', 'no comparison "slow"', '"slower"?']),
        ("oracle: slower", "oracle: nearest", ['say of which "scenario" it is']),
        ("oracle: slower", "scenario: rude.1, oracle: slower", ["names its scenarios itself"]),
        ("oracle: slower, sut: pilot", "oracle: slower, sut: pylot", ['"pilot"?']),
        ('source: "The same robot, last year"', 'source: ""', ["tiny.yaml:31", "source"]),
        ("statistic: min", "statistic: least", ["statistic: must be 'mean'"]),
    ],
)  # fmt: skip
def test_reference_values_that_nothing_can_stand_beside_are_refused(folder, old, new, expected):
    assert old in REFERENCE
    with pytest.raises(InputError) as caught:
        load(folder, CAMPAIGN + REFERENCE.replace(old, new, 1))
    found = "\n".join(str(diagnostic) for diagnostic in caught.value.diagnostics)
    for part in expected:
        assert part in found
