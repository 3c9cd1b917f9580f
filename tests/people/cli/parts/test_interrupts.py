"""An interrupt that comes while libraries load ends the command, whatever they do with it."""

import subprocess
import sys
from pathlib import Path

import pytest

DEMO = Path("campaigns/demo/campaign.yaml").absolute()
PROGRAM = """
import os, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r} and self in sys.meta_path:
            sys.meta_path.remove(self)
            try:
                os.kill(os.getpid(), signal.SIGINT)
                for _ in range(1000): pass
            except KeyboardInterrupt:
                {fate}
        return None

# Whoever starts the tests in the background may have interrupts be ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
import scenario_tui
sys.meta_path.insert(0, Interrupting())
from scenario_tui.cli import main
main({words!r})
"""
SWALLOWED, TURNED, RAISED = "pass", "raise SystemError('init of a library failed')", "raise"


def interrupted(folder, module, fate, *words):
    program = PROGRAM.format(module=module, fate=fate, words=list(words))
    command = [sys.executable, "-c", program]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize(
    ("module", "fate"),
    [("pydantic", SWALLOWED), ("numpy", TURNED)],
)
def test_a_run_that_is_interrupted_while_libraries_load_runs_nothing(tmp_path, module, fate):
    done = interrupted(tmp_path, module, fate, "run", str(DEMO), "-o", "out")
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert "bug" not in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("fate", [SWALLOWED, RAISED])
def test_the_command_line_itself_may_be_interrupted(tmp_path, fate):
    done = interrupted(tmp_path, "typer", fate, "--version")
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
