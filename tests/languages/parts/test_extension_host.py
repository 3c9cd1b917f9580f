"""The extension for VS Code, in a stand-in of VS Code: it shows what the check finds."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.languages.test_extension import VSCODE

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
SCENARIO = str(Path(sys.executable).with_name("scenario"))


@pytest.fixture
def hosted(tmp_path):
    """Run the extension on a file; return what it showed."""

    def run(name, text, language, command, trust="trusted"):
        (tmp_path / name).write_text(text)
        host = Path(__file__).with_name("extension_host.js")
        extension = [VSCODE / "extension.js", tmp_path, tmp_path / name, language, command, trust]
        done = subprocess.run(
            ["node", host, *extension],
            capture_output=True,
            text=True,
            check=True,
            start_new_session=True,
        )
        return json.loads(done.stdout)

    return run


def test_problems_appear_in_the_file_they_are_in(hosted, tmp_path):
    text = "kitchen_door stays open\nkitchen_door stys closed\n"
    answer = hosted("doors.scenery", text, "scenery", SCENARIO)
    (problem,) = answer["diagnostics"][str(tmp_path / "doors.scenery")]
    assert problem["range"]["start"]["line"] == 1
    assert (problem["severity"], problem["source"]) == (0, "scenario")
    assert answer["lines"] == answer["afterClosing"] == []


def test_a_missing_command_is_explained_in_the_output(hosted):
    answer = hosted("doors.scenery", "door stays open\n", "scenery", "./nowhere/scenario")
    assert answer["diagnostics"] == {}
    assert any("scenario.command" in line for line in answer["lines"])


@pytest.mark.parametrize(
    ("name", "text", "language", "trust"),
    [
        ("doors.scenery", "door stys open\n", "scenery", "untrusted"),
        ("compose.yaml", "robot: unknown\n", "yaml", "trusted"),
    ],
)
def test_nothing_is_run_for_untrusted_folders_and_files_of_others(
    hosted, name, text, language, trust
):
    answer = hosted(name, text, language, "./nowhere/scenario", trust)
    assert (answer["lines"], answer["diagnostics"]) == ([], {})


def test_campaigns_are_offered_as_tasks(hosted):
    answer = hosted("notes.txt", "", "plaintext", "scenario")
    task = answer["task"]
    assert task["definition"] == {"type": "scenario", "file": "campaign.yaml"}
    assert task["execution"] == {"program": "scenario", "args": ["check", "campaign.yaml"]}
    assert task["matcher"] == "$scenario"
    assert answer["again"]["execution"] == task["execution"]
