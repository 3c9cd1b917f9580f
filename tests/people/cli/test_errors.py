"""Whatever goes wrong ends with a message and the exit code that says whose fault it is."""

import errno
from pathlib import Path

import pytest

from grammars.text.diagnostics import Finding, InputError, Severity, Where
from scenario_tui.cli import command_line
from scenario_tui.cli.answer import CommandError, ExitCode, exit_code
from tests.people.cli.outputs import declared


@pytest.fixture
def raising(monkeypatch):
    def prepare(error):
        def fail(**_):
            raise error

        monkeypatch.setattr(command_line, "app", fail)

    return prepare


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["pass", "pass"], ExitCode.EXPECTED),
        (["pass", "fail", "lost"], ExitCode.UNEXPECTED),
        (["pass", "lost", "inconclusive"], ExitCode.INFRASTRUCTURE),
        (["pass", "error"], ExitCode.INFRASTRUCTURE),
        (["pass", "inconclusive"], ExitCode.INCONCLUSIVE),
        (["pass", "cancelled"], ExitCode.INCONCLUSIVE),
        ([], ExitCode.INCONCLUSIVE),
    ],
)
def test_the_exit_code_follows_the_gravest_run(words, code):
    assert exit_code(words) is code


def test_the_error_of_the_docs_is_one(campaigns):
    text = (campaigns.parent / "docs" / "command-line.md").read_text("utf-8")
    declared(text.partition("```json\n")[2].partition("```")[0])


def test_a_missing_campaign_lists_those_there_are(scenario, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "`scenario new my-tests` writes one" in scenario("run", "x.yaml").err
    for name in ("alpha", "beta"):
        (tmp_path / f"{name}.yaml").write_text(f"campaign: {name}\n")
    assert "campaign files here: " in scenario("run", "x.yaml").err


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (CommandError("no run fails", ExitCode.INCONCLUSIVE), 4, "no run fails"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_a_command_without_an_answer_writes_the_reason(raising, capsys, error, code, told):
    raising(error)
    assert command_line.invoke(["blame", "c.0", "--json"]) == code
    body = declared(capsys.readouterr().out)
    assert (body["error"], body["exit_code"]) == (told, code)


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (
            ZeroDivisionError("division by zero"),
            70,
            "scenario: a bug in scenario, please report it: ZeroDivisionError: division by zero\n",
        ),
        (BrokenPipeError(), 141, ""),
        (
            OSError(errno.ENOSPC, "No space left on device", "/results/run.mcap"),
            3,
            "scenario: No space left on device: /results/run.mcap\n",
        ),
    ],
)
def test_what_went_wrong_is_said_in_a_line(raising, capsys, error, code, told):
    raising(error)
    assert command_line.invoke(["status"]) == code
    said = capsys.readouterr()
    assert (said.out, said.err.splitlines(keepends=True)[-1:]) == ("", [told] if told else [])


def test_findings_are_shown_in_their_files(raising, capsys, tmp_path, monkeypatch, golden):
    monkeypatch.chdir(tmp_path)
    Path("plan.fpm").write_text("space hall\n    shape: rectangel\n")
    findings = [
        Finding(Where("plan.fpm", 2, 12), "no such shape", 'did you mean "rectangle"?'),
        Finding(Where("plan.fpm"), "no entryway", severity=Severity.WARNING),
        # A place that is not in the file has no excerpt.
        Finding(Where("plan.fpm", 99, 1), "gone"),
        Finding(Where("none.yaml", 1, 1), "gone"),
    ]
    raising(InputError(findings))
    assert command_line.invoke(["check", "plan.fpm"]) == 2
    golden("output/findings.txt", capsys.readouterr().err)


def test_a_malformed_endpoint_in_the_environment_is_bad_input(monkeypatch, capsys):
    monkeypatch.setenv("SCENARIO_CONNECT", "garbage")
    assert command_line.invoke(["status"]) == ExitCode.BAD_INPUT
    said = capsys.readouterr().err
    assert said.startswith("SCENARIO_CONNECT: error: 'garbage' is not an endpoint")
