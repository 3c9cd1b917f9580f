"""Words for scripts and editors: schemas, ``--json``, exit codes, the table of commands, units."""

import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from scenario_tui.cli import command_line
from scenario_tui.cli.answer import ExitCode, write_json
from scenario_tui.cli.commands import COMMANDS, load_command
from scenario_tui.cli.output_schemas import VALUES
from tests.people.cli.outputs import declared
from tests.people.fake import CAMPAIGN

DOC = Path(__file__).parents[3] / "docs" / "command-line.md"
SILENT = {"tui", "serve", "worker", "schema", "replay"}
"""Commands that stay, or write files for editors: the others answer with ``--json``."""


def _rows(heading):
    """Return the cells of the table below a heading of the documentation."""
    text = DOC.read_text("utf-8").partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


def test_the_schema_of_outputs_is_a_schema_of_every_answer(scenario, tmp_path):
    assert scenario("schema", "--outputs", "-o", str(tmp_path)).code == 0
    schema = json.loads((tmp_path / "outputs.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    names = [body["$ref"].rpartition("/")[2] for body in schema["oneOf"]]
    assert names == list(VALUES)


def test_every_command_that_answers_does_so_for_machines():
    speaking = {name for name in COMMANDS if _speaks(load_command(name))}
    assert set(COMMANDS) - speaking == SILENT


def _speaks(command):
    inner = getattr(command, "commands", {}).values()
    own = any("--json" in parameter.opts for parameter in command.params)
    return own or any(map(_speaks, inner))


@dataclass(frozen=True)
class Margins:
    least: tuple[float, ...]
    named: dict[str, float]


def test_numbers_that_json_has_not_are_null(capsys):
    write_json("margins", Margins((float("inf"), 1.5), {"a": float("nan")}))
    body = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert body == {"schema": "scenario/margins/1", "least": [None, 1.5], "named": {"a": None}}


def test_the_table_of_exit_codes_is_true():
    told = {int(number.strip("`")): word.lower() for number, word, *_ in _rows("Exit codes")}
    assert told == {code.value: code.name.lower().replace("_", " ") for code in ExitCode}


def test_the_table_of_commands_is_true():
    told = {}
    for names, outputs, _ in _rows("Commands"):
        written = set(re.findall(r"`(\w+)`", outputs))
        told |= dict.fromkeys(re.findall(r"`(\w+)`", names), written)
    assert set(told) == set(COMMANDS)
    # What any command writes that has no other answer is explained below the table.
    assert set().union(*told.values()) | {"error"} == set(VALUES)
    assert {name for name, outputs in told.items() if not outputs} == SILENT


def test_piped_output_is_as_wide_as_it_is_told(scenario, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    table = scenario("status").out.splitlines()[-2:]
    assert max(map(len, table)) <= 60
    listed = scenario("results", CAMPAIGN, "--outcome", "fail").out.splitlines()
    assert max(map(len, listed)) <= 60


def test_check_tells_editors_where_and_what(tmp_path, capsys):
    broken = tmp_path / "round.mission.yaml"
    broken.write_text("mission: round\nwaypoint:\n  - {x: 1, y: 2 deg}\n")
    fine = tmp_path / "home.mission.yaml"
    fine.write_text("waypoints: [{x: 0, y: 0}]\n")
    assert command_line.invoke(["check", "--json", str(broken), str(fine)]) == 2
    files = declared(capsys.readouterr().out)["files"]
    assert files[str(fine)] == []
    (unknown,) = (found for found in files[str(broken)] if found["where"]["line"] == 2)
    assert unknown["where"] == {"file": str(broken), "line": 2, "column": 1}
    assert (unknown["severity"], unknown["hint"]) == ("error", 'did you mean "waypoints"?')


def test_schemas_and_the_extension_are_written(scenario, tmp_path):
    folder = tmp_path / "new"
    written = scenario("schema", "--out", str(folder)).out.splitlines()
    kinds = ("campaign", "mission", "oracles", "robot", "sut", "walls")
    assert sorted(written) == [f"{folder / kind}.schema.json" for kind in kinds]
    schema = (folder / "robot.schema.json").read_text()
    assert scenario("schema", "robot").out == schema
    one = scenario("schema", "walls", "-o", str(tmp_path / "one")).out.splitlines()
    assert one == [str(path) for path in (tmp_path / "one").iterdir()]
    assert json.loads(schema)["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    with zipfile.ZipFile(scenario("schema", "--vscode", str(tmp_path)).out.strip()) as archive:
        assert "extension/schemas/campaign.schema.json" in archive.namelist()
        assert archive.testzip() is None


@pytest.mark.parametrize(
    ("words", "settings"),
    [
        ("daemon --state mine --slots 2", '"daemon" "--state" "{0}/mine" "--slots" "2"\n'),
        (
            "daemon --listen tls/[::]:7447 --keys k --state k",
            '"--keys" "{0}/k" "--state" "{0}/k" "--listen" "tls/[::]:7447"\n',
        ),
        ("worker --state here", '"worker" "--state" "{0}/here"\n'),
        ("worker --connect tcp/far:7447", '"worker" "--connect" "tcp/far:7447"\n'),
        (
            "worker --dask tls://host:8786 --nice 5 --wall 10min --memory 1GiB",
            '"--dask" "tls://host:8786" "--nice" "5" "--wall" "10min" "--memory" "1GiB"\n',
        ),
    ],
)
def test_units_say_what_was_asked_by_absolute_paths(
    words, settings, scenario, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    unit = scenario(*words.split(), "--print-unit").out
    assert settings.format(tmp_path) in unit
    assert ("\nNice=5\n" in unit) == ("--nice" in words)
