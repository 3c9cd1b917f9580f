"""TAB: what is offered for the word being typed, and that nothing else is said."""

import os
import shutil
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.messages import Completion
from daemon.model.verdicts import Outcome
from scenario_tui.cli import invoke
from tests.make import make_result, make_spec, submission_of

NOW = 1_000_000.0


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


FILES = {
    "house.yaml": "campaign: h\nsearch: {doors: {about: a}, noise: {}}\n",
    "mine.yaml": "sut: mine\nkind: pilot\n",
    "other.yaml": "robot: other\n",
    "tests/inner/one.yaml": "# about\ncampaign: one\n",
    "tests/inner/robot.yaml": "robot: r\ncampaigns: 3\n",
    "tests/inner/plan.fpm": "",
    "tests/inner/run.mcap": "",
}
OFFERED = {
    "res": "results",
    "results --exit": "--exit-status",
    # Campaigns by id and by name, the newest first.
    "cancel ": "new-1 old-1",
    "results old": "old-1",
    "results x": "",
    # No shell takes the name "Campaign old-1" as one word.
    "results Camp": "",
    # Runs of a campaign, failures first; campaigns before runs where several are meant.
    **{
        f"{command} old-1.": "old-1.2 old-1.0 old-1.1"
        for command in ("replay", "plot", "blame", "export", "judge")
    },
    "replay ": "new-1. old-1. tests/inner/run.mcap",
    "replay n": "new-1.0",
    "blame old-1.2 --oracle ": "arrives",
    "replay old-1.2 --from arr": "arrives",
    "replay old-1.7 --from ": "",
    "results old-1 --filter ": "S2 pilot arrives",
    "retry old-1 --only l": "lost",
    "results --outcome i": "inconclusive",
    "results --baseline last": "last-green",
    "search ": "new-1 old-1 house.yaml",
    "search house.yaml --method h": "halton",
    "run te": "tests/inner/one.yaml",
    "export tests/inner/": "tests/inner/plan.fpm tests/inner/run.mcap tests/inner/one.yaml",
    "replay tests/inner/r": "tests/inner/run.mcap",
    "run tests/inner/r": "",  # then the shell offers every file
    "judge o": "old-1 old-1.2 old-1.0 old-1.1",
    "sut show m": "mine.yaml",
    "sut check ": "mine.yaml tests/",
    # Another daemon has other names.
    "results --connect tcp/127.0.0.1:7 old": "",
    "replay --connect tcp/127.0.0.1:7 old-1.": "",
    "replay --connect tcp/127.0.0.1:7 old-1.2 --from arr": "",
    "results --connect tcp/127.0.0.1:7 old-1 --filter ": "",
}
"""What TAB offers behind a line."""


def test_names_files_and_words_are_offered(tab, tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert {line: " ".join(tab(f"scenario {line}")) for line in OFFERED} == OFFERED
    assert "loc.error" in tab("scenario plot old-1.0 loc.e")
    assert "--json" in tab("scenario sut show mine.yaml --")


@pytest.mark.parametrize("content", [None, b"no ledger", b""])
def test_nothing_without_a_usable_ledger(tab, tmp_path, monkeypatch, content):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    if content is not None:
        (tmp_path / "ledger.db").write_bytes(content)
    assert tab("scenario results ") == []
    assert tab("scenario replay c.") == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ledger.db"] * (content is not None)


def test_another_daemon_of_the_environment_has_other_names(tab, monkeypatch):
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
