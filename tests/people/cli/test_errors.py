"""Whatever goes wrong ends with a message and the exit code that says whose fault it is."""

import errno

import pytest

from grammars.text.diagnostics import Finding, InputError, Severity, Where
from scenario_tui.cli import command_line
from scenario_tui.cli.exit_codes import CommandError, ExitCode, exit_code
from scenario_tui.text.diagnostics import render_diagnostic
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


def test_our_own_bugs_exit_with_70_and_say_so(raising, capsys):
    raising(ZeroDivisionError("division by zero"))
    assert command_line.invoke(["status"]) == 70
    said = capsys.readouterr()
    assert said.out == ""
    assert "a bug in scenario, please report it: ZeroDivisionError" in said.err


def test_a_reader_that_leaves_is_no_failure(raising):
    raising(BrokenPipeError())
    assert command_line.invoke(["results"]) == 141


def test_bad_input_prints_every_diagnostic(raising, capsys, tmp_path):
    file = tmp_path / "plan.fpm"
    file.write_text("space hall\n    shape: rectangel\n")
    raising(
        InputError(
            [
                Finding(Where(str(file), 2, 12), "no such shape", 'did you mean "rectangle"?'),
                Finding(Where(str(file)), "no entryway", severity=Severity.WARNING),
            ]
        )
    )
    assert command_line.invoke(["check", "plan.fpm"]) == 2
    said = capsys.readouterr().err
    assert "plan.fpm:2:12: error: no such shape" in said
    assert "    shape: rectangel\n           ^\n" in said
    assert 'did you mean "rectangle"?' in said
    assert "warning: no entryway" in said
    assert said.rstrip().endswith("1 error, 1 warning")
    assert "Traceback" not in said


def test_a_place_outside_the_file_has_no_excerpt(tmp_path):
    file = tmp_path / "short.yaml"
    file.write_text("campaign: x\n")
    shown = render_diagnostic(Finding(Where(str(file), 99, 1), "gone")).plain
    assert shown == f"{file}:99:1: error: gone"
    missing = render_diagnostic(Finding(Where(str(tmp_path / "none.yaml"), 1, 1), "gone")).plain
    assert missing.endswith("error: gone")


def test_a_full_disk_is_no_bug_of_ours(raising, capsys):
    raising(OSError(errno.ENOSPC, "No space left on device", "/results/run.mcap"))
    assert command_line.invoke(["run"]) == ExitCode.INFRASTRUCTURE
    assert capsys.readouterr().err == "scenario: No space left on device: /results/run.mcap\n"


def test_a_dashboard_without_a_terminal_says_so(scenario, fake):
    said = scenario("tui")
    assert said.code == ExitCode.BAD_INPUT
    assert "the dashboard needs a terminal" in said.err
    assert fake.calls == []


def test_a_malformed_endpoint_in_the_environment_is_bad_input(monkeypatch, capsys):
    monkeypatch.setenv("SCENARIO_CONNECT", "garbage")
    assert command_line.invoke(["status"]) == ExitCode.BAD_INPUT
    said = capsys.readouterr().err
    assert said.startswith("SCENARIO_CONNECT: error: 'garbage' is not an endpoint")
    assert "write tcp/<host>:<port>" in said


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
