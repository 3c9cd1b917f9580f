"""What terminals, pipes and shells do with what commands write, in processes of their own."""

import json
import os
import subprocess
import sys
from pathlib import Path

from scenario_tui.cli.answer import ExitCode
from tests.parts import ROOT
from tests.people.cli.real import COMMAND
from tests.people.cli.test_completion import state
from tests.people.poison import NAME, WORD, assert_harmless

__all__ = ["state"]


def _typed(*arguments, shell="", **variables):
    command = [*COMMAND, *arguments]
    if shell:
        command = ["sh", "-c", f'"$@" {shell}', "sh", *command]
    environment = os.environ | variables
    return subprocess.run(
        command, capture_output=True, text=True, errors="replace", env=environment
    )


def test_a_closed_output_is_no_failure(tmp_path):
    assert _typed("--version", shell=">&-").returncode == 0
    missing = str(tmp_path / "none.yaml")
    assert _typed("check", missing, shell=">&- 2>&-").returncode == ExitCode.BAD_INPUT


def test_an_output_that_takes_nothing_is_said():
    said = _typed("--version", shell=">/dev/full")
    assert said.returncode == ExitCode.INFRASTRUCTURE
    assert said.stderr == "scenario: No space left on device\n"


def test_signs_a_terminal_cannot_show_stop_nothing(tmp_path):
    said = _typed("check", str(tmp_path / "größe.yaml"), PYTHONIOENCODING="ascii")
    assert said.returncode == ExitCode.BAD_INPUT
    assert "Traceback" not in said.stderr


def test_a_terminal_without_our_signs_still_shows_a_minus():
    program = "from scenario_tui.cli import output as o; o.settle_streams(); print('✗ −0.3 ü')"
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-c", program]
    assert subprocess.check_output(command, env=environment) == b"x -0.3 u\n"


def test_a_reader_that_leaves_early_causes_no_noise():
    reading, writing = os.pipe()
    os.close(reading)  # before it begins: or it may be done before the reader leaves
    with os.fdopen(writing, "wb") as broken:
        done = subprocess.run([*COMMAND, "check", "none.yaml"], stderr=broken)
        assert done.returncode == ExitCode.BAD_INPUT
        done = subprocess.run([*COMMAND, "--version"], stdout=broken, stderr=subprocess.PIPE)
        assert (done.returncode, done.stderr) == (141, b"")


def test_what_daemons_and_workers_say_is_harmless():
    order = json.dumps({"state": f"/dev/null/{NAME}"})
    said = subprocess.run(
        [sys.executable, "-m", "daemon", "serve", order], capture_output=True, cwd=ROOT
    )
    assert said.returncode == 3
    assert WORD in assert_harmless(said.stderr)


def test_bash_takes_what_is_offered(state, tmp_path):
    program = Path(sys.executable).with_name("scenario")
    script = (
        f'eval "$({program} --show-completion bash)"\n'
        "COMP_WORDS=(scenario replay old-1.); COMP_CWORD=2\n"
        f"_scenario_completion {program}\n"
        'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    environment = os.environ | {"SCENARIO_STATE": str(state)}
    command = ["bash", "--norc", "-c", script]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (done.stdout.split(), done.stderr) == (["old-1.2", "old-1.0", "old-1.1"], "")
