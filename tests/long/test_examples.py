"""Every line that help shows as an example is typed, as it stands, and does what it should."""

import importlib.resources
import re
import shlex
import shutil

import pytest

from daemon.batch import launch
from grammars.model.map_files import write_map
from scenario_tui.cli.commands import EXAMPLES, load_command
from tests.people.cli.commands import commands
from tests.people.cli.real import call_here
from tests.scene.maps.imported import house

STAY = {
    "scenario serve campaign.yaml --scenario open-house --headless": "goes on until Ctrl-C",
    "scenario daemon": "goes on until Ctrl-C",
    "scenario daemon --listen tls/0.0.0.0:7447 --slots 0": "goes on, and takes keys and a port",
    "scenario worker --connect tls/build.example:7447 -j 8": "the daemon is another machine",
    "scenario sut check my_stack.yaml": "the stack needs ROS 2",
    "scenario tui": "needs a terminal",
    "scenario tui --read-only": "needs a terminal",
    "scenario replay nightly.0": "needs a terminal",
}
"""Lines that cannot be typed here to the end, and why: they are read by the command line only."""
CAMPAIGN = """\
campaign: nightly
about: Two short runs, one of which has too little time.
seed: 7
limit: 20 s
robot: courier
oracles: navigation
map: {rule: touch}
matrix: {sut: [pilot]}
scenarios:
  open-house:
    floorplan: flat
    objects: doors
    behaviours: doors_moving
    mission: courier
    oracles: [no-contact, keeps-clear, nearest]
  hurried: {like: open-house, limit: 4 s, oracles: [reached]}
expect:
  - {scenario: hurried, oracle: reached, verdict: fail, why: "nobody is that fast"}
search:
  doors-in-time:
    scenario: open-house
    minimise: keeps-clear
    over: {doors_moving.bedroom_closes: 5.1 .. 6.9 s}
    budget: 60 runs
"""
WORDS = sorted(
    {words.partition(" ")[0] for words in EXAMPLES}, key=lambda word: (word == "daemon", word)
)
"""First words of commands; the daemon comes last, for one of its examples ends it."""
WRITTEN = {
    "new": "my-tests/campaign.yaml",
    "export": "jsonld/flat.jsonld",
    "import": "home.walls.yaml",
    "schema": "scenario.vsix",
}
"""A file that examples of a command leave."""


_NEXT_STEP = re.compile(r"^  (scenario .+?)(?:   *[^ ].*)?$", re.MULTILINE)


@pytest.fixture(scope="module")
def place(tmp_path_factory, campaigns):
    """A folder with what the examples name, and a daemon that has finished its campaign."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(campaigns / "demo", folder, dirs_exist_ok=True)
    (folder / "campaign.yaml").write_text(CAMPAIGN)
    write_map(house(), folder / "map", laser_height=0.2)
    # What ships is demonstrated with less of it.
    (folder / "shipped" / "demo").mkdir(parents=True)
    shutil.copytree(campaigns / "demo", folder / "shipped" / "demo", dirs_exist_ok=True)
    (folder / "shipped" / "demo" / "campaign.yaml").write_text(CAMPAIGN)
    done = call_here("submit", "campaign.yaml", "--watch", state=folder / "state", cwd=folder)
    assert done.returncode == 0, done.stderr
    yield folder
    call_here("daemon", "--stop", state=folder / "state", cwd=folder)


def test_every_command_has_examples_and_every_example_its_command():
    assert set(EXAMPLES) == {words for words, _ in commands()}
    for words, lines in EXAMPLES.items():
        assert lines
        for line in lines:
            assert f"{line} ".startswith(f"scenario {words} ")
            assert len(line) <= 75, "longer ones would be wrapped where help is read"
    assert set(STAY) <= {line for lines in EXAMPLES.values() for line in lines}


@pytest.mark.parametrize("word", WORDS)
def test_examples_do_what_they_show(word, place, monkeypatch):
    files = importlib.resources.files
    shipped = {"campaigns": place / "shipped"}
    monkeypatch.setattr(importlib.resources, "files", lambda name: shipped.get(name) or files(name))
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(place / "home"))
    monkeypatch.chdir(place)
    detached, start = [], launch.start_detached
    monkeypatch.setattr(
        launch, "start_detached", lambda *words: detached.append(start(*words)) or detached[-1]
    )
    # What an example before this one has queued is not what the next one is about.
    assert call_here("wait", "nightly", state=place / "state", cwd=place).returncode == 0
    for words, lines in EXAMPLES.items():
        if words.partition(" ")[0] != word:
            continue
        for line in lines:
            arguments = shlex.split(line.partition(" > ")[0])[1:]
            if line in STAY:
                _read(arguments)
                continue
            done = call_here(*arguments, state=place / "state", cwd=place)
            assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
            # The next steps of the demo are about files that its first one writes.
            steps = [] if word == "demo" else _NEXT_STEP.findall(done.stdout)
            for step in steps:
                _read(shlex.split(step)[1:])
    for process in detached:
        process.wait()  # otherwise it would wait for the daemon, which is stopped in the end
    if word in WRITTEN:
        assert (place / WRITTEN[word]).is_file()


def _read(arguments):
    """Read what was typed as far as the command line does, and call nothing."""
    command = load_command(arguments[0])
    arguments = arguments[1:]
    while True:
        inner = getattr(command, "get_command", None)
        if inner is None:
            break
        command = inner(None, arguments[0])
        arguments = arguments[1:]
    command.make_context("scenario", list(arguments))
