"""What is typed wrongly is told in a sentence, with exit code 2, for every option there is."""

import re
import socket

import typer

from scenario_tui.cli import command_line
from tests.people.cli.commands import commands

LIBRARY_WORDS = re.compile(
    r"validation error|Value error|type=|pydantic|Traceback|Errno|\bValueError"
)
"""Words of libraries, which people have not typed and cannot mend."""
UNTRIED = {"demo", "acknowledge", "cancel", "pause", "sut relay"}
"""Commands that take nothing, or the same as others."""
FILES = {
    "mine.yaml": "campaign: mine\nlimit: 3\nrepeats: [1]\nscenarios: 4\nmatrix: {sut: 7}\n",
    "deep.yaml": "campaign: deep\nlimit: 1 s\nscenarios:\n  a: {floorplan: 3, oracles: {a: 1},"
    " chance: maybe, like: [b]}\nexpect: [{verdict: maybe}, 3]\nmap: {rule: 3}\n",
    "house.yaml": "campaign: house\nlimit: 2 min\nscenarios: {}\nrepeats: fife\n",
    "robot.yaml": "robot: [3]\ndrive: {kind: wheels}\nlaser: 7\nfootprint: [[1]]\n",
    "sut.yaml": "sut: x\nkind: pilot\nparameters: {max_speed: fast, sides: [1]}\n",
    "ros.yaml": "sut: x\nkind: ros\nparameters: {amcl: {max_particles: many}, move_base: 3}\n",
    "a.mission.yaml": "mission: a\nstart: {x: far}\nwaypoints: [{x: 1}, 3, {id: 3, y: []}]\n",
    "a.oracles.yaml": "near: 3\nfar: [1]\n",
    "broken/campaign.json": '{"name": 1}',
    "other.json": "[]",
    "torn.json": "",
    "status.json": '{"schema": "scenario/status/1"}',
    "registered/register.json": '{"issued": [{"name": 3}]}',
}


def test_bad_values_are_told_in_a_sentence(place, transcript):
    for name, text in FILES.items():
        (place / name).parent.mkdir(exist_ok=True)
        (place / name).write_text(text)
    (place / "broken" / "run.mcap").symlink_to(place / "run.mcap")
    text = transcript("bad_values")
    typed = re.findall(r"^\$ scenario (.*)$", text, re.MULTILINE)
    assert text.count("\nexit 2\n") == len(typed)
    assert not LIBRARY_WORDS.search(text)
    tried = {words for words, _ in commands() if any(f"{t} ".startswith(words) for t in typed)}
    assert {words for words, _ in commands()} - tried == UNTRIED


def test_no_number_is_said_with_the_option(scenario, monkeypatch):
    # Made once: typer makes all commands anew each time they are called.
    monkeypatch.setattr(command_line, "app", typer.main.get_command(command_line.app))
    tried = list(number_options())
    assert len(tried) > 30
    for words, option in tried:
        said = scenario(*words.split(), f"{option}=nope")
        assert said.code == 2
        assert option in said.err
        assert not LIBRARY_WORDS.search(said.err)
        # Amounts (20GiB, 10min) have words of their own.
        assert "should be a valid " in said.err or "is not a" in said.err


def number_options():
    """Yield the words of commands, each with an option that takes a number."""
    for words, command in commands():
        for parameter in command.params:
            named = [name for name in parameter.opts if name.startswith("--")]
            kind = parameter.type_descriptor.annotation if named else None
            is_number = {int, float} & {kind, *getattr(kind, "__args__", ())}
            if named and is_number and not parameter.is_flag:
                yield words, named[0]


def test_an_address_that_is_taken_is_told(place, scenario):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        said = scenario("daemon", "--listen", f"tcp/127.0.0.1:{port}", "--state", "mine")
    assert said.code == 2
    assert "cannot listen at" in said.err
    assert "Traceback" not in said.err


def test_settings_are_spoken_of_in_our_words(place, scenario):
    folder = place / "home" / "scenario"
    folder.mkdir(parents=True)
    (folder / "config.toml").write_text('theme = 3\nread_only = "maybe"\n[keys]\nx = [1]\n')
    said = scenario("doctor", "--quick")
    told = [line for line in said.out.splitlines() if "pydantic 2" not in line]
    assert not LIBRARY_WORDS.search("\n".join(told))
