"""What is typed wrongly is told in a sentence, with exit code 2, for every option there is."""

import re
import shutil
import socket

import pytest
import typer

from scenario_tui.cli import command_line
from tests.people.cli.test_poisoned import commands

LIBRARY_WORDS = re.compile(
    r"validation error|Value error|type=|pydantic|Traceback|Errno|\bValueError"
)
"""Words of libraries, which people have not typed and cannot mend."""


def said_well(code, out, err):
    """Hold what a command said to what people are told: code 2, a sentence, nothing else."""
    assert code == 2, err
    assert out == "" or "scenario/error/1" in out
    assert err.strip()
    assert not LIBRARY_WORDS.search(err), err


def options(kind):
    """Return the words of commands, each with an option whose parameter is of a kind."""
    for words, command in commands():
        for parameter in command.params:
            named = [name for name in parameter.opts if name.startswith("--")]
            if named and not parameter.is_flag and kind(parameter):
                yield words, named[0]


def _is_number(parameter):
    kind = parameter.type_descriptor.annotation
    return bool({int, float} & {kind, *getattr(kind, "__args__", ())})


@pytest.fixture(scope="module", autouse=True)
def _made_once():
    """Make the commands once: typer makes all of them anew each time they are called."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command_line, "app", typer.main.get_command(command_line.app))
        yield


def test_no_number_is_said_with_the_option_and_its_bounds(scenario):
    tried = list(options(_is_number))
    assert len(tried) > 30
    for words, option in tried:
        said = scenario(*words.split(), f"{option}=nope")
        said_well(*said)
        assert option in said.err
        # Amounts (20GiB, 10min) have words of their own.
        assert "should be a valid " in said.err or "is not a" in said.err
    assert "greater than or equal to 1" in scenario("run", "c.yaml", "-j", "0").err
    assert "greater than or equal to 0" in scenario("export", "x", "map", "--laser-height=-1").err


@pytest.fixture
def place(tmp_path, campaigns, monkeypatch):
    """A folder with a campaign, and with things of the wrong kind."""
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, tmp_path / part)
    (tmp_path / "taken").write_text("x: [\n")
    (tmp_path / "raw.mcap").write_bytes(bytes(range(256)))
    (tmp_path / "raw.yaml").write_bytes(bytes(range(256)))
    for name in ("HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


CASES = (
    # (what is typed, part of what is said)
    ("run demo/campaign.yaml --wall soon", "'soon"),
    ("run demo/campaign.yaml --wall -3s", "-3s"),
    ("run demo/campaign.yaml --wall 0", "longer than 0 s"),
    ("run demo/campaign.yaml --junit none/x.xml", "none is not there"),
    ("run demo/campaign.yaml --junit demo", "is a"),
    ("run demo/campaign.yaml --out taken", "taken"),
    ("run demo", "is a folder"),
    ("run taken", "taken"),
    ("run raw.yaml", "raw.yaml"),
    ("run none.yaml", "no such file"),
    ("check none.yaml", "no such file"),
    ("submit none.yaml", "no such file"),
    ("wait first --timeout soon", "'soon' is not a time"),
    ("wait first --timeout -3s", "-3s"),
    ("search demo/campaign.yaml --budget none", "none"),
    ("search demo/campaign.yaml --stop never", "never"),
    ("search demo/campaign.yaml nothing", "nothing"),
    ("serve demo/campaign.yaml --scenario nowhere", "nowhere"),
    ("serve demo/campaign.yaml --sut nobody", "nobody"),
    ("serve demo/campaign.yaml --speed -1", "speed"),
    ("tui --web --public-url lab.example", "is no address of a page"),
    ("tui --port 8001", "this is for --web"),
    ("new taken", "is there already"),
    ("new .", "is there already"),
    ("new mine --floorplan none.fpm", "no such file"),
    ("new none --layers", "none is not there"),
    ("results nope", 'no campaign "nope"'),
    ("results --outcome passed", '"passed" is no verdict: did you mean "pass"?'),
    ("report -o page.pdf", "page.pdf is a page: end it in .html"),
    ("show nope.1", 'no campaign "nope"'),
    ("show raw.mcap --log", "raw.mcap"),
    ("show none.mcap --log", "none.mcap"),
    ("replay none.mcap --frame 1", "none.mcap"),
    ("replay raw.mcap --frame 1", "raw.mcap"),
    ("plot none.mcap speed", "none.mcap"),
    ("judge none.mcap", "none.mcap"),
    ("judge raw.mcap", "is no trace"),
    ("judge taken", "is no trace"),
    ("judge raw.mcap --oracles none.oracles.yaml", "no such file"),
    ("verify none.mcap", "none.mcap"),
    ("coverage none.yaml", "none.yaml"),
    ("blame none.mcap", "none.mcap"),
    ("compare first nope", "nope"),
    ("report nope", 'no campaign "nope"'),
    ("report demo -o none/x.html", "none is not there"),
    ("report demo -o demo", "is a folder"),
    ("report demo --table none/x.csv", "none is not there"),
    ("report demo --table x.xlsx", "a table ends with .parquet"),
    ("export flat.fpm map", "no such file"),
    ("export demo/flat.fpm map -o taken/x", "taken"),
    ("export demo/flat.fpm prov --timestamp noon", "does not match the formats"),
    ("export none.mcap picture -o x.svg", "none.mcap"),
    ("export none.mcap picture -o x.txt", ".svg, .png or .pdf"),
    ("vary none.variation", "none.variation"),
    ("import none.yaml", "none.yaml"),
    ("import demo/campaign.yaml", "campaign.yaml"),
    ("schema campaign -o taken", "taken"),
    ("schema --vscode taken", "taken"),
    ("sut show nobody", "nobody"),
    ("sut check nobody", "nobody"),
    ("retry first --only sometimes", "sometimes"),
    ("priority first soon", "should be a valid integer"),
    ("delete nope --yes", 'no campaign "nope"'),
    ("gc --older-than soon", "'soon' is not an age"),
    ("gc --max-size big", "big"),
    ("gc --state none", "no ledger in"),
    ("daemon --quota big", "big"),
    ("daemon --connect tcp/127.0.0.1:1", "goes with --stop only"),
    ("daemon --json", "goes with --stop only"),
    ("daemon --listen somewhere:", "not an endpoint"),
    ("daemon --traces somewhere", "somewhere"),
    ("daemon --state taken", "taken cannot be used"),
    ("worker --memory big", "big"),
    ("worker --connect somewhere:", "not an endpoint"),
    ("worker --connect tcp/127.0.0.1:1", "no daemon answers"),
    ("worker --dask somewhere", "somewhere"),
    ("keys issue king me --keys none", "is not one of 'viewer'"),
    ("keys issue viewer me --keys none", "`scenario keys init` makes one"),
    ("keys list --keys none", "there are no keys in"),
    ("keys revoke me --keys none", "none"),
    ("keys bundle me -o x.tar --keys none", "there are no keys in"),
    ("keys init taken", "taken"),
    ("doctor --quick --traces", "leave one out"),
)


@pytest.mark.parametrize(("typed", "part"), CASES)
def test_a_bad_value_is_told_in_a_sentence(typed, part, place, scenario):
    said = scenario(*typed.split())
    said_well(*said)
    assert part in said.err


def test_every_command_that_takes_something_is_tried():
    tried = {words for words, _ in commands() if any(f"{t} ".startswith(words) for t, _ in CASES)}
    left = {words for words, _ in commands()} - tried
    assert left == {"demo", "status", "cancel", "acknowledge", "pause", "sut relay"}


def test_an_address_that_is_taken_is_told(place, scenario):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        said = scenario("daemon", "--listen", f"tcp/127.0.0.1:{port}", "--state", "mine")
    assert said.code == 2
    assert "cannot listen at" in said.err
    assert "Traceback" not in said.err


FILES = {
    "mine.yaml": "campaign: mine\nlimit: 3\nrepeats: [1]\nscenarios: 4\nmatrix: {sut: 7}\n",
    "deep.yaml": "campaign: deep\nlimit: 1 s\nscenarios:\n  a: {floorplan: 3, oracles: {a: 1},"
    " chance: maybe, like: [b]}\nexpect: [{verdict: maybe}, 3]\nmap: {rule: 3}\n",
    "robot.yaml": "robot: [3]\ndrive: {kind: wheels}\nlaser: 7\nfootprint: [[1]]\n",
    "sut.yaml": "sut: x\nkind: pilot\nparameters: {max_speed: fast, sides: [1]}\n",
    "ros.yaml": "sut: x\nkind: ros\nparameters: {amcl: {max_particles: many}, move_base: 3}\n",
    "a.mission.yaml": "mission: a\nstart: {x: far}\nwaypoints: [{x: 1}, 3, {id: 3, y: []}]\n",
    "a.oracles.yaml": "near: 3\nfar: [1]\n",
}


@pytest.mark.parametrize("name", FILES)
def test_files_are_spoken_of_in_our_words(name, place, scenario):
    (place / name).write_text(FILES[name])
    said = scenario("check", name)
    said_well(*said)
    assert f"{name}:" in said.err


def test_settings_and_registers_are_spoken_of_in_our_words(place, scenario, monkeypatch):
    folder = place / "home" / "scenario"
    folder.mkdir(parents=True)
    (folder / "config.toml").write_text('theme = 3\nread_only = "maybe"\n[keys]\nx = [1]\n')
    said = scenario("doctor", "--quick")
    told = [line for line in said.out.splitlines() if "pydantic 2" not in line]
    assert not LIBRARY_WORDS.search("\n".join(told))
    (place / "keys").mkdir()
    (place / "keys" / "register.json").write_text('{"issued": [{"name": 3}]}')
    said_well(*scenario("keys", "list", "--keys", "keys"))
