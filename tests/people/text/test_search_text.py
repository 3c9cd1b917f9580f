"""A search in words: how far it is, what it found, what decides."""

import math
import shlex
from dataclasses import replace

from scenario_tui.text.search_text import (
    answer_lines,
    finding_lines,
    influence_lines,
    parameters_text,
    search_commands,
)
from tests.people.fake_search import TASK, make_answer, make_search


def test_a_value_below_nought_has_the_minus_of_margins_and_files_keep_theirs():
    swing = replace(TASK.parameters[1], low=-0.5, written=-0.1, unit="m")
    assert "−0.1 → −0.124 m" in parameters_text(replace(TASK, parameters=(swing,)), (-0.124,), 80)
    assert swing.override(-0.124) == "-0.124 m"
    named = replace(TASK.parameters[2], choices=("left-door",))
    assert named.shown("left-door") == "left-door"


def test_a_finding_has_the_margin_of_the_oracle_that_fails():
    answer = make_answer()
    (finding,) = answer.findings
    other = replace(finding.example.value, oracle="reached", margin=0.5)
    example = replace(finding.example, value=other)
    (line,) = finding_lines(replace(answer, findings=(replace(finding, example=example),)))
    assert "−0.031 m at 31.5 s" in line.plain


def test_a_search_without_an_answer_says_how_it_stands():
    lines = [line.plain for line in answer_lines(make_search("failed", note="flat.fpm:3: gone"))]
    assert lines[0] == "doors-in-time  ‼ flat.fpm:3: gone"
    assert "it could not go on" in lines[-1]


def test_what_chance_gives_as_well_is_dim():
    first, *others = influence_lines(TASK, make_answer())
    assert not first.style
    assert all(line.style for line in others)


def test_influence_of_a_flat_margin_is_nothing():
    answer = make_answer()
    flat = replace(answer.influence[0], correlation=math.nan)
    (line,) = influence_lines(TASK, replace(answer, influence=(flat,)))
    assert line.plain.endswith("nan")


def test_commands_about_the_found_file_can_be_copied():
    lines = [shlex.split(line) for line, _ in search_commands(make_search(), "a b/x.found.yaml")]
    about = [words for words in lines if "a b/x.found.yaml" in words]
    assert [words[1] for words in about] == ["run", "blame", "export"]
    assert about[1][3:] == ["doors-in-time.4", "pilot"]
