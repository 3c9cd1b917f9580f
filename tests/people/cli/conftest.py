"""Transcripts of commands: golden files that list the commands and all that these say."""

import re
import shlex
import shutil

import pytest
import typer

from scenario_tui.cli import command_line
from tests.people.fake import make_live, state_paths
from tests.people.recorded import record_run


@pytest.fixture
def place(tmp_path, campaigns, monkeypatch):
    """A folder with the demo, a recorded run, and things of the wrong kind."""
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, tmp_path / part)
    record_run(tmp_path / "run.mcap")
    (tmp_path / "taken").write_text("x: [\n")
    (tmp_path / "raw.mcap").write_bytes(bytes(range(256)))
    (tmp_path / "raw.yaml").write_bytes(bytes(range(256)))
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "nightly.yaml").write_text("# about\ncampaign: nightly-tests   # name\n")
    for name in ("HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def transcript(scenario, golden, request, fake, tmp_path, monkeypatch):
    """Type the commands of a file, and compare what they say with it; returns its text."""
    monkeypatch.setenv("SCENARIO_CONNECT", "tcp/127.0.0.1:7447")
    # Made once: typer makes all commands anew each time they are called.
    monkeypatch.setattr(command_line, "app", typer.main.get_command(command_line.app))

    def told(line):
        said = scenario(*shlex.split(line)[1:])
        message = [one for one in said.err.splitlines() if not one.startswith(("Usage:", "Try '"))]
        printed = [*said.out.splitlines(), *(f"2> {one}" for one in message if one)]
        code = [f"exit {int(said.code)}"] if said.code else []
        return "\n".join((f"$ {line}", *map(settled, (*printed, *code)), ""))

    def settled(text):
        """Leave out what is another on each machine, how large pages are and how long it took."""
        for folder, name in ((tmp_path, "HERE"), (state_paths().state, "STATE")):
            text = text.replace(str(folder), name)
        text = re.sub(r"runs, \d+ s;", "runs, TIME;", text)
        return re.sub(r"\([0-9.]+ [kM]?B\)", "(SIZE)", text).rstrip()

    def compare(name):
        file = f"output/{name}.txt"
        written = (request.path.parent / file).read_text("utf-8").splitlines()
        text = "\n".join(told(line[2:]) for line in written if line.startswith("$ "))
        golden(file, text)
        return text

    return compare


@pytest.fixture
def under_way(fake):
    """Have run 7 tell how far it is as soon as it is watched."""
    watch = fake.watch

    def watch_at_once(run, on_live, on_judged=None):
        on_live(make_live(7, time=61.0))
        return watch(run, on_live, on_judged)

    fake.watch = watch_at_once
