"""The extension for VS Code: what it declares is there, and it shows what the check finds."""

import io
import json
import re
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import pytest

import grammars.editor
from grammars.editor import pack_extension
from grammars.text.diagnostics import Finding, Severity, Where
from scenario_tui.text.diagnostics import render_diagnostic

VSCODE = Path(grammars.editor.__file__).parent / "vscode"
PACKAGE = json.loads((VSCODE / "package.json").read_text(encoding="utf-8"))
CONTRIBUTES = PACKAGE["contributes"]


def packed():
    with zipfile.ZipFile(io.BytesIO(pack_extension())) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_the_packed_extension_holds_every_file_it_speaks_of():
    named = [PACKAGE["main"]]
    named += [lang["configuration"] for lang in CONTRIBUTES["languages"]]
    named += [grammar["path"] for grammar in CONTRIBUTES["grammars"]]
    named += [schema["url"] for schema in CONTRIBUTES["yamlValidation"]]
    files = packed()
    assert {f"extension/{name.removeprefix('./')}" for name in named} <= set(files)
    assert {"[Content_Types].xml", "extension/package.json", "extension/README.md"} <= set(files)


def test_the_manifest_is_that_of_the_package():
    manifest = ElementTree.fromstring(packed()["extension.vsixmanifest"])
    space = {"v": "http://schemas.microsoft.com/developer/vsx-schema/2011"}
    identity = manifest.find("v:Metadata/v:Identity", space)
    assert identity is not None
    for key in ("Version", "Publisher"):
        assert identity.get(key) == PACKAGE[key.lower()]
    assert identity.get("Id") == PACKAGE["name"]
    types = ElementTree.fromstring(packed()["[Content_Types].xml"])
    endings = {entry.get("Extension") for entry in types}
    assert {Path(name).suffix for name in packed()} - {".xml"} <= endings


def test_the_extension_has_the_version_of_the_project():
    assert PACKAGE["version"] == version("scenario-tui")


def test_packing_twice_gives_the_same_bytes():
    assert pack_extension() == pack_extension()


def test_scopes_and_endings_are_those_of_the_grammars():
    for entry in CONTRIBUTES["grammars"]:
        grammar = json.loads((VSCODE / entry["path"]).read_text(encoding="utf-8"))
        assert grammar["scopeName"] == entry["scopeName"]
    endings = {end for lang in CONTRIBUTES["languages"] for end in lang["extensions"]}
    assert endings == {".fpm", ".scenery", ".variation"}


@pytest.mark.parametrize("severity", list(Severity))
@pytest.mark.parametrize("column", [0, 5])
def test_the_problem_matcher_reads_what_the_check_prints(severity, column):
    (pattern,) = CONTRIBUTES["problemPatterns"]
    found = Finding(Where("a b/flat.fpm", 7, column), "no wall: 9", "walls are 0-5", severity)
    lines = render_diagnostic(found).plain.splitlines()
    match = re.match(pattern["regexp"], lines[0])
    assert match
    said = {key: match[pattern[key]] for key in ("file", "line", "column", "severity", "message")}
    assert said == {
        "file": "a b/flat.fpm",
        "line": "7",
        "column": str(column) if column else None,
        "severity": severity.value,
        "message": "no wall: 9",
    }
    assert not any(re.match(pattern["regexp"], line) for line in lines[1:])


needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")


def hosted(folder, file, language, command, trust="trusted"):
    """Run the extension in a stand-in of VS Code on one file; return what it showed."""
    host = Path(__file__).with_name("extension_host.js")
    arguments = [VSCODE / "extension.js", folder, file, language, command, trust]
    done = subprocess.run(
        ["node", host, *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=240,
        start_new_session=True,
    )
    return json.loads(done.stdout)


@needs_node
def test_problems_appear_in_the_file_they_are_in(tmp_path):
    layer = tmp_path / "doors.scenery"
    layer.write_text("kitchen_door stays open\nkitchen_door stys closed\n")
    command = str(Path(sys.executable).with_name("scenario"))
    answer = hosted(tmp_path, layer, "scenery", command)
    (found,) = answer["diagnostics"][str(layer)]
    assert found["range"]["start"]["line"] == 1
    assert found["severity"] == 0
    assert found["source"] == "scenario"
    assert answer["lines"] == []
    assert answer["afterClosing"] == []


@needs_node
def test_a_missing_command_is_explained_in_the_output(tmp_path):
    layer = tmp_path / "doors.scenery"
    layer.write_text("kitchen_door stays open\n")
    answer = hosted(tmp_path, layer, "scenery", "./nowhere/scenario")
    assert answer["diagnostics"] == {}
    assert any("scenario.command" in line for line in answer["lines"])


@needs_node
def test_nothing_is_run_in_folders_that_are_not_trusted(tmp_path):
    layer = tmp_path / "doors.scenery"
    layer.write_text("kitchen_door stys open\n")
    answer = hosted(tmp_path, layer, "scenery", "./nowhere/scenario", "untrusted")
    assert answer["lines"] == []
    assert answer["diagnostics"] == {}


@needs_node
def test_yaml_files_of_others_are_left_alone(tmp_path):
    other = tmp_path / "compose.yaml"
    other.write_text("robot: unknown\n")
    answer = hosted(tmp_path, other, "yaml", "./nowhere/scenario")
    assert answer["lines"] == []


@needs_node
def test_campaigns_are_offered_as_tasks(tmp_path):
    other = tmp_path / "notes.txt"
    other.write_text("")
    answer = hosted(tmp_path, other, "plaintext", "scenario")
    task = answer["task"]
    assert task["definition"] == {"type": "scenario", "file": "campaign.yaml"}
    assert task["execution"] == {"program": "scenario", "args": ["check", "campaign.yaml"]}
    assert task["matcher"] == "$scenario"
    assert answer["again"]["execution"] == task["execution"]
