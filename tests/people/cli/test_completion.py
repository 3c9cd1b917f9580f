"""TAB: what is offered for the word being typed, and that nothing else is said."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.messages import Completion
from daemon.model.verdicts import Outcome
from scenario_tui.cli import invoke
from tests.make import make_result, make_spec, submission_of

NOW = 1_000_000.0
Tab = Callable[[str], list[str]]


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """A state directory with a finished campaign, whose last run failed, and a queued one."""
    folder = tmp_path_factory.mktemp("state")
    with closing(connect(folder / "ledger.db")) as ledger:
        book = LedgerWriter(ledger)
        book.submit(submission_of("old-1", *(make_spec(i, scenario="S2") for i in range(3))), NOW)
        for grant in book.lease("w", 9, NOW):
            outcome = Outcome.FAIL if grant.spec.repeat == 2 else Outcome.PASS
            result = make_result(grant.spec, outcome=outcome)
            done = Completion("w", grant.run, grant.attempt, grant.token, result)
            book.complete(done, NOW)
        book.submit(submission_of("new-1", make_spec(0)), NOW)
    return folder


@pytest.fixture
def tab(state, tmp_path, monkeypatch, capsys):
    """Press TAB behind a line, in an empty folder, with the state directory of the tests."""
    monkeypatch.setenv("SCENARIO_STATE", str(state))
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.setenv("_SCENARIO_COMPLETE", "complete_bash")
    monkeypatch.chdir(tmp_path)

    def press(line):
        words = line.split(" ")
        monkeypatch.setenv("COMP_WORDS", "\n".join(words))
        monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
        assert invoke([]) == 0
        said = capsys.readouterr()
        assert said.err == ""
        return said.out.split()

    return press


def test_commands_and_options(tab):
    assert tab("scenario res") == ["results"]
    assert tab("scenario results --exit") == ["--exit-status"]


def test_campaigns_by_id_and_by_name_the_newest_first(tab):
    assert tab("scenario cancel ") == ["new-1", "old-1"]
    assert tab("scenario results old") == ["old-1"]
    assert tab("scenario results x") == []


def test_names_no_shell_takes_as_one_word_are_left_out(tab):
    assert not [word for word in tab("scenario results Camp") if word]


@pytest.mark.parametrize("command", ["replay", "plot", "blame", "export", "judge"])
def test_runs_of_a_campaign_failures_first(tab, command):
    assert tab(f"scenario {command} old-1.") == ["old-1.2", "old-1.0", "old-1.1"]


def test_campaigns_before_runs_where_several_are_meant(tab):
    assert tab("scenario replay ") == ["new-1.", "old-1."]
    assert tab("scenario replay n") == ["new-1.0"]


def test_oracles_of_the_run_that_was_named(tab):
    assert tab("scenario blame old-1.2 --oracle ") == ["arrives"]
    assert tab("scenario replay old-1.2 --from arr") == ["arrives"]
    assert tab("scenario replay old-1.7 --from ") == []


def test_what_runs_mention(tab):
    assert tab("scenario results old-1 --filter ") == ["S2", "pilot", "arrives"]


def test_words_and_signals(tab):
    assert tab("scenario retry old-1 --only l") == ["lost"]
    assert tab("scenario results --outcome i") == ["inconclusive"]
    assert "loc.error" in tab("scenario plot old-1.0 loc.e")
    assert tab("scenario results --baseline last") == ["last-green"]


def test_campaign_files_and_campaigns(tab, tmp_path):
    (tmp_path / "house.yaml").write_text("campaign: h\nsearch: {doors: {about: a}, noise: {}}\n")
    assert tab("scenario search ") == ["new-1", "old-1", "house.yaml"]
    assert tab("scenario search house.yaml --method h") == ["halton"]


def test_files_that_fit(tab, tmp_path):
    inner = tmp_path / "tests" / "inner"
    inner.mkdir(parents=True)
    (inner / "one.yaml").write_text("# about\ncampaign: one\n")
    (inner / "robot.yaml").write_text("robot: r\ncampaigns: 3\n")
    (inner / "plan.fpm").write_text("")
    (inner / "run.mcap").write_text("")
    assert tab("scenario run te") == ["tests/inner/one.yaml"]
    assert tab("scenario export tests/inner/") == [
        "tests/inner/plan.fpm",
        "tests/inner/run.mcap",
        "tests/inner/one.yaml",
    ]
    assert tab("scenario replay tests/inner/r") == ["tests/inner/run.mcap"]
    assert tab("scenario run tests/inner/r") == []  # then the shell offers every file
    assert tab("scenario judge o") == ["old-1", "old-1.2", "old-1.0", "old-1.1"]


def test_systems_are_offered_to_commands_about_one(tab, tmp_path):
    (tmp_path / "mine.yaml").write_text("sut: mine\nkind: pilot\n")
    (tmp_path / "other.yaml").write_text("robot: other\n")
    assert tab("scenario sut show m") == ["mine.yaml"]
    assert tab("scenario sut check ") == ["mine.yaml"]
    assert "--json" in tab("scenario sut show mine.yaml --")


@pytest.mark.parametrize("content", [None, b"no ledger", b""])
def test_nothing_without_a_usable_ledger(tab, tmp_path, monkeypatch, content):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    if content is not None:
        (tmp_path / "ledger.db").write_bytes(content)
    assert tab("scenario results ") == []
    assert tab("scenario replay c.") == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ledger.db"] * (content is not None)


def test_another_daemon_has_other_names(tab, monkeypatch):
    assert tab("scenario results --connect tcp/127.0.0.1:7 old") == []
    assert tab("scenario replay --connect tcp/127.0.0.1:7 old-1.") == []
    assert tab("scenario replay --connect tcp/127.0.0.1:7 old-1.2 --from arr") == []
    assert tab("scenario results --connect tcp/127.0.0.1:7 old-1 --filter ") == []
    monkeypatch.setenv("SCENARIO_CONNECT", "tcp/127.0.0.1:7")
    assert tab("scenario results old") == []


def test_fish_is_told_by_the_exit_code(state, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(state))
    monkeypatch.setenv("_SCENARIO_COMPLETE", "complete_fish")
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "is-args")
    codes = []
    for line in ("scenario cancel old", "scenario cancel nothing"):
        monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
        codes.append(invoke([]))
    assert codes == [0, 1]


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_a_real_bash_takes_what_is_offered(state, tmp_path):
    program = Path(sys.executable).with_name("scenario")
    script = (
        f'eval "$({program} --show-completion bash)"\n'
        "COMP_WORDS=(scenario replay old-1.); COMP_CWORD=2\n"
        f"_scenario_completion {program}\n"
        'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(
        ["bash", "--norc", "-c", script],
        cwd=tmp_path,
        env=os.environ | {"SCENARIO_STATE": str(state)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.split(), done.stderr) == (["old-1.2", "old-1.0", "old-1.1"], "")
