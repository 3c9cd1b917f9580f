"""The command line in a process of its own, and a short campaign for it."""

import io
import re
import shutil
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

import pytest

from scenario_tui.cli import invoke

COMMAND = [sys.executable, "-c", "from scenario_tui.cli import main; main()"]


def call_here(*arguments, state, cwd):
    """Call a command in this process, as if in another folder: it is spared a start."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(cwd)
        patch.delenv("SCENARIO_CONNECT", raising=False)
        patch.setenv("SCENARIO_STATE", str(state))
        code = invoke(arguments)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def short_demo(folder, campaigns):
    """Fill a folder with the demo campaign cut down to two short runs."""
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, folder / "campaigns" / part)
    file = folder / "campaigns" / "demo" / "campaign.yaml"
    text = file.read_text()
    text = re.sub(r"^repeats: \d+", "repeats: 2", text, flags=re.M)
    text = re.sub(r"^limit: [^#\n]+", "limit: 20 s ", text, flags=re.M)
    file.write_text(text[: text.index("  busy-house:")])
    return folder


def endless(file):
    """Write a short demo with so many runs beside it that it does not end by itself."""
    path = file.with_name("endless.yaml")
    path.write_text(file.read_text().replace("repeats: 2", "repeats: 100"))
    return path
