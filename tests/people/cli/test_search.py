"""Searching from the command line: what is handed over, watched, told and written."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console
from rich.live import Live

from daemon.campaign import expand, load_campaign
from daemon.model.search import SearchSubmission
from daemon.search.answers.sentences import phase_words, search_word
from daemon.search.preparation import PreparedSearch
from scenario_tui.cli import search
from scenario_tui.cli.answer import ExitCode
from scenario_tui.cli.search import _read_changes, copy_campaign, search_code
from scenario_tui.library.submission import searches_text
from scenario_tui.library.watching import ProgressDisplay, WatchedSearch
from scenario_tui.text.search_text import search_line
from tests.people.cli.outputs import declared
from tests.people.fake_search import MARGINS, SEARCH, TASK, make_answer, make_proposals, make_search


@pytest.fixture(autouse=True)
def _here(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("campaign.yaml").write_text("campaign: house\n")


def _interrupt(_):
    raise KeyboardInterrupt


def _have(fake, row):
    """Have the daemon know a search with its runs."""
    fake.found, fake.proposed = (row,), make_proposals()


def test_a_search_that_is_over_is_told_with_its_found_file_and_commands(scenario, fake):
    _have(fake, make_search())
    body = declared(scenario("search", SEARCH, "--json").out)
    assert (body["search"]["campaign"], len(body["proposals"])) == (SEARCH, len(MARGINS))
    assert body["found"] == ""
    # Its client wrote that one, with the layers of the campaign.
    found = Path("scenario-results", "search", SEARCH, "campaign/house/doors-in-time.found.yaml")
    found.parent.mkdir(parents=True)
    found.touch()
    said = scenario("search", SEARCH)
    assert said.code == ExitCode.UNEXPECTED
    assert f"scenario run {found}" in said.out
    assert declared(scenario("search", SEARCH, "--json").out)["found"] == str(found)


def test_how_a_search_stands_is_a_word_a_phrase_and_a_code(golden):
    answer = make_answer()
    none = replace(answer, first=None, failed=0)
    rows = {
        "finished": make_search(),
        "finished without a failure": make_search(answer=replace(none, ended="settled")),
        "finished by errors": make_search(answer=replace(none, ended="errors")),
        "finished without a result": make_search(answer=replace(none, best=None)),
        "running": make_search("running"),
        "running with a failure": make_search("running", answer=answer),
        "failed": make_search("failed", note="no"),
        "cancelled": make_search("cancelled"),
        "cancelled with a failure": make_search("cancelled", answer=answer),
        "waiting with a failure": make_search("waiting", answer=answer),
    }
    lines = []
    for name, row in rows.items():
        code = search_code(row).name if row.state != "running" else "-"
        lines.append(
            f"{name} | {search_word(row)} | {phase_words(row)} | {code}\n  {search_line(row)}\n"
        )
    golden("output/search_states.txt", "".join(lines))


def test_options_change_what_is_asked():
    change = _read_changes("200", "5 failures", "halton", 3, 1)
    task = change(TASK)
    assert (task.runs, task.seconds, task.stop, task.failures) == (200, 0.0, "failures", 5)
    assert (task.method, task.seed, task.confirm) == ("halton", 3, 1)
    assert change(replace(TASK, repeatable=False)).confirm == 3
    assert _read_changes("10 min", "", "", None, None)(TASK).seconds == 600.0
    assert _read_changes("", "", "", None, None)(TASK) == TASK


def _prepared(monkeypatch):
    """Have a campaign file be the search of the tests; returns its tasks and the file."""
    tasks = []

    def prepare(path, name="", *, client, change, find, fresh):
        tasks.append(change(TASK))
        found = SearchSubmission(SEARCH, "house", "", "", tasks[-1], f"{path}", client=client)
        return PreparedSearch(found, None, ())

    monkeypatch.setattr("daemon.search.preparation.prepare_search", prepare)
    monkeypatch.setenv("SCENARIO_CONNECT", "tcp/127.0.0.1:7")
    return tasks, Path("campaign.yaml")


def test_a_search_that_runs_in_the_background_is_told_as_it_stands(scenario, fake, monkeypatch):
    tasks, file = _prepared(monkeypatch)
    monkeypatch.setattr(search, "_detach", lambda *_, **__: make_search("running"))
    said = scenario("search", str(file), "--budget", "200 runs", "--detach")
    assert said.code == 0
    assert said.err == f"submitted {SEARCH}: 3 parameters of busy-house, at most 200 runs\n"
    assert f"scenario cancel {SEARCH}" in said.out
    assert tasks[0].runs == 200


def test_interrupted_a_search_waits_for_the_command_that_goes_on(scenario, fake, monkeypatch):
    _, file = _prepared(monkeypatch)
    left = []
    client = SimpleNamespace(
        start=lambda: None, is_alive=lambda: not left, leave=lambda: left.append(True)
    )
    monkeypatch.setattr(search, "_client_of", lambda *_: client)
    fake.at({12: _interrupt})
    said = scenario("search", str(file))
    assert said.code == ExitCode.INTERRUPTED
    assert left
    assert f"continue it with `scenario search {file} {SEARCH}`" in said.err
    assert f"end it with `scenario cancel {SEARCH}`" in said.err


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ("finished", "exists already, its answer is kept"),
        ("running", "exists already and continues after 8 runs"),
        ("cancelled", "exists already and continues after 8 runs"),
    ],
)
def test_the_same_search_goes_on(scenario, fake, monkeypatch, state, words):
    _, file = _prepared(monkeypatch)
    monkeypatch.setattr(search, "_detach", lambda *_, **__: fake.found[0])
    _have(fake, make_search(state))
    said = scenario("search", str(file), "--detach")
    assert said.err.startswith(f"{SEARCH} {words} (--fresh starts anew)\n")
    assert ("lab-7 runs it" in said.err) is (state == "running")


def test_watching_tells_the_first_failure_and_what_it_goes_on_with(scenario, fake):
    _have(fake, make_search("running"))

    def change(**changes):
        fake.found = (replace(fake.found[0], **changes),)

    fake.at(
        {
            8: lambda _: change(answer=make_answer()),
            14: lambda _: change(phase="nearest"),
            20: lambda _: change(state="finished", phase="explore"),
        }
    )
    said = scenario("search", SEARCH)
    assert said.code == ExitCode.UNEXPECTED
    assert said.err.splitlines() == [
        f"run 4 fails: keeps-clear by −0.012 m ({SEARCH}.4)",
        "looking for the nearest failure",
    ]


@pytest.mark.parametrize(
    ("phase", "note", "shown"),
    [
        ("confirm", "run 1 again, 5 times with other noise", True),
        # The line has newer numbers.
        ("explore", "1 of 60 runs, best -7.3 m", False),
    ],
)
def test_what_a_search_does_is_said_where_it_is_watched(fake, phase, note, shown):
    row = make_search("running", phase=phase, note=note)
    _have(fake, row)
    watched = WatchedSearch(SEARCH)
    watched.look(fake, ProgressDisplay(Live(console=Console())))
    console = Console(width=100, record=True)
    console.print(watched.draw({}, "compiling kernels 7/42"))
    _, about, *_, waiting = console.export_text().splitlines()
    assert about == f"  {search_line(row).removeprefix('doors-in-time: ')}"
    assert waiting == "  compiling kernels 7/42"
    assert (note in about) is shown
    assert (note in search_line(row)) is shown


def test_submitting_a_campaign_says_which_searches_it_has(scenario, fake, campaigns, monkeypatch):
    monkeypatch.setenv("SCENARIO_CONNECT", "tcp/127.0.0.1:7")
    file = campaigns / "demo" / "campaign.yaml"
    said = scenario("submit", str(file))
    assert said.code == 0
    assert f"doors-in-time is a search: start it with `scenario search {file}`" in said.err
    both = "a, b are searches: start one with `scenario search 'x y/campaign.yaml' a`"
    assert searches_text(Path("x y/campaign.yaml"), ("a", "b")) == both
    assert searches_text(file, ()) == ""


def test_a_copied_campaign_means_the_same_runs_without_any_file_around_it(place):
    above = place / "shared.mission.yaml"
    above.write_bytes((place / "demo" / "courier.mission.yaml").read_bytes())
    file = place / "demo" / "own.yaml"
    text = (place / "demo" / "campaign.yaml").read_text().partition("search:")[0]
    file.write_text(text.replace("mission: courier", "mission: ../shared.mission.yaml"))
    digests = expand(load_campaign(file)).digests
    copied = copy_campaign(file, place / "handed on")
    for name in ("demo", "robots", "suts"):
        shutil.rmtree(place / name)
    above.unlink()
    assert expand(load_campaign(copied / "own.yaml")).digests == digests
