"""The commands that serve editors: schemas to print or write, the extension as a file."""

import json
import shutil
import zipfile
from pathlib import Path

from scenario_tui.cli import command_line
from tests.people.cli.outputs import declared


def test_a_schema_is_printed(capsys):
    assert command_line.invoke(["schema", "robot"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert "footprint" in schema["required"]


def test_all_schemas_are_written(tmp_path, capsys):
    assert command_line.invoke(["schema", "--out", str(tmp_path / "new")]) == 0
    written = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert sorted(written) == sorted((tmp_path / "new").iterdir())
    kinds = ("campaign", "mission", "oracles", "robot", "sut", "walls")
    assert sorted(path.name for path in written) == [f"{kind}.schema.json" for kind in kinds]


def test_one_schema_is_written(tmp_path):
    assert command_line.invoke(["schema", "sut", "-o", str(tmp_path)]) == 0
    assert [p.name for p in tmp_path.iterdir()] == ["sut.schema.json"]


def test_the_extension_is_written(tmp_path, capsys):
    assert command_line.invoke(["schema", "--vscode", str(tmp_path)]) == 0
    path = Path(capsys.readouterr().out.strip())
    with zipfile.ZipFile(path) as archive:
        assert "extension/schemas/campaign.schema.json" in archive.namelist()
        assert archive.testzip() is None


def test_check_tells_editors_where_and_what(tmp_path, capsys):
    broken = tmp_path / "round.mission.yaml"
    broken.write_text("mission: round\nwaypoint:\n  - {x: 1, y: 2 deg}\n")
    fine = tmp_path / "home.mission.yaml"
    fine.write_text("waypoints: [{x: 0, y: 0}]\n")
    assert command_line.invoke(["check", "--json", str(broken), str(fine)]) == 2
    report = declared(capsys.readouterr().out)
    assert report["schema"] == "scenario/check/1"
    assert report["files"][str(fine)] == []
    unknown = next(d for d in report["files"][str(broken)] if d["where"]["line"] == 2)
    assert unknown["where"] == {"file": str(broken), "line": 2, "column": 1}
    assert unknown["severity"] == "error"
    assert "waypoint" in unknown["message"]
    assert unknown["hint"] == 'did you mean "waypoints"?'


def test_check_reads_variations(campaigns, tmp_path, capsys):
    assert command_line.invoke(["check", str(campaigns / "demo" / "flat.variation")]) == 0
    assert "variation of flat" in capsys.readouterr().err
    shutil.copy(campaigns / "demo" / "flat.fpm", tmp_path)
    broken = tmp_path / "flat.variation"
    broken.write_text('import "flat.fpm"\nkitchn: { shape.width: uniform(3 .. 4) }\n')
    assert command_line.invoke(["check", "--json", str(broken)]) == 2
    (found,) = declared(capsys.readouterr().out)["files"][str(broken)]
    assert found["where"] == {"file": str(broken), "line": 2, "column": 1}
    assert "kitchen" in found["hint"]
