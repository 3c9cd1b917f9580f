"""The extension for VS Code: what it declares is there."""

import io
import json
import re
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


def test_the_packed_extension_is_complete_and_the_same_each_time():
    data = pack_extension()
    assert data == pack_extension()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    named = [PACKAGE["main"]]
    named += [lang["configuration"] for lang in CONTRIBUTES["languages"]]
    named += [grammar["path"] for grammar in CONTRIBUTES["grammars"]]
    named += [schema["url"] for schema in CONTRIBUTES["yamlValidation"]]
    assert {f"extension/{name.removeprefix('./')}" for name in named} <= set(files)
    assert {"[Content_Types].xml", "extension/package.json", "extension/README.md"} <= set(files)
    manifest = ElementTree.fromstring(files["extension.vsixmanifest"])
    space = {"v": "http://schemas.microsoft.com/developer/vsx-schema/2011"}
    identity = manifest.find("v:Metadata/v:Identity", space)
    expected = [PACKAGE[key] for key in ("name", "version", "publisher")]
    assert [identity.get(key) for key in ("Id", "Version", "Publisher")] == expected
    types = ElementTree.fromstring(files["[Content_Types].xml"])
    endings = {entry.get("Extension") for entry in types}
    assert {Path(name).suffix for name in files} - {".xml"} <= endings


def test_version_scopes_and_endings_are_those_of_the_project():
    assert PACKAGE["version"] == version("scenario-tui")
    for entry in CONTRIBUTES["grammars"]:
        grammar = json.loads((VSCODE / entry["path"]).read_text(encoding="utf-8"))
        assert grammar["scopeName"] == entry["scopeName"]
    endings = {end for lang in CONTRIBUTES["languages"] for end in lang["extensions"]}
    assert endings == {".fpm", ".scenery", ".variation"}


@pytest.mark.parametrize("severity", list(Severity))
@pytest.mark.parametrize("column", [0, 5])
def test_the_problem_matcher_reads_what_the_check_prints(severity, column):
    (pattern,) = CONTRIBUTES["problemPatterns"]
    finding = Finding(Where("a b/flat.fpm", 7, column), "no wall: 9", "walls are 0-5", severity)
    lines = render_diagnostic(finding).plain.splitlines()
    match = re.match(pattern["regexp"], lines[0])
    keys = ("file", "line", "column", "severity", "message")
    assert [match[pattern[key]] for key in keys] == [
        "a b/flat.fpm",
        "7",
        str(column) if column else None,
        severity.value,
        "no wall: 9",
    ]
    assert not any(re.match(pattern["regexp"], line) for line in lines[1:])
