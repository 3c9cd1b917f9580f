"""TAB: what is offered for the word being typed, and that nothing else is said."""

from contextlib import closing

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


def test_names_files_and_words_are_offered(tab, tmp_path, golden, request):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    written = (request.path.parent / "output" / "completion.txt").read_text("utf-8").splitlines()
    lines = [line.partition("|")[0] for line in written]
    offered = (f"{line}| {' '.join(tab(line))}".rstrip() for line in lines)
    golden("output/completion.txt", "\n".join((*offered, "")))
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


def test_fish_is_told_by_the_exit_code(state, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(state))
    monkeypatch.setenv("_SCENARIO_COMPLETE", "complete_fish")
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "is-args")
    codes = []
    for line in ("scenario cancel old", "scenario cancel nothing"):
        monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
        codes.append(invoke([]))
    assert codes == [0, 1]
