"""Follows the tutorial of the dashboard key by key, in a shell of a terminal of its own.

The steps are the rows of the tables in the document: what is pressed, and words that are seen then.
What stands in backquotes is typed; everything else is for people. Runs of other
campaigns than the demo are executed so slowly that one can watch.
"""

import itertools
import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from daemon import run
from daemon.run_loop import WATCHED_RATE
from tests.people.terminal.pseudo_terminal import ROOT, terminal

DOCUMENT = ROOT / "docs" / "tutorials" / "first-hour.md"
SIZE = (120, 32)
_HEADING = "| press | you see |"
_KEYS = {"⏎": "\r", "esc": "\x1b", "tab": "\t", "space": " "}
_PROMPT = "$ "
EXECUTOR = f"{__name__}:execute"
_COMMAND = f"""\
#!{sys.executable}
from daemon.model import execution
execution.DEFAULT_EXECUTOR = "{EXECUTOR}"
from scenario_tui.cli import main
main()
"""
"""The command line of this working copy, whose daemon executes runs slowly."""


@dataclass(frozen=True)
class Step:
    """What is typed, one after the other, and the words that are on the screen then.

    ``section`` is the heading it stands below.
    """

    keys: tuple[str, ...]
    words: tuple[str, ...]
    section: str = ""


def read_steps(text):
    """Return the steps of a document in their order."""
    steps, inside, section = [], False, ""
    for line in text.splitlines():
        section = line.removeprefix("## ") if line.startswith("## ") else section
        inside = line == _HEADING or (inside and line.startswith("|"))
        if inside and "`" in line:
            pressed, seen = (
                tuple(re.findall("`([^`]+)`", cell)) for cell in line.strip("|").split("|", 1)
            )
            steps.append(Step(pressed, seen, section))
    return tuple(steps)


def follow(shell, steps, until=None, before=lambda _: None, then=lambda _: None):
    """Take the steps, and wait after each, by ``until``, for what is to be seen.

    ``before`` and ``then`` are called before and after each step.
    """
    until = until or shell.until
    until(lambda: _PROMPT.rstrip() in shell.text)
    for step in steps:
        before(step)
        for key in step.keys:
            shell.type(_KEYS.get(key, key))
        until(partial(_shown, shell, step))
        then(step)


def _shown(shell, step):
    # A shell wraps lines that hold the path of a folder anywhere, in the middle of a word too.
    text, wrapped = shell.text, shell.text.replace("\n", "")
    return all(word in text or word in wrapped for word in step.words)


@contextmanager
def shell_in(folder):
    """Open a shell in a folder with short campaigns, whose ``scenario`` is that of this copy.

    A daemon that was started in it and not stopped is stopped in the end.
    """
    _copy_campaigns(folder / "robot" / "campaigns")
    commands = folder / "bin"
    commands.mkdir()
    command = commands / "scenario"
    command.write_text(_COMMAND)
    command.chmod(0o755)
    around = {
        "HOME": str(folder),
        "PATH": f"{commands}:/usr/bin:/bin",
        "PS1": _PROMPT,
        "PYTHONPATH": str(ROOT),
        "SCENARIO_STATE": str(folder / "state"),
        "SCENARIO_GLYPHS": "unicode",
    }
    start = ["/bin/sh", "-c", 'cd "$0" && exec /bin/sh -i', str(folder / "robot")]
    try:
        with terminal(start, columns=SIZE[0], rows=SIZE[1], environ=around) as shell:
            yield shell
    finally:
        # Who fails on the way leaves a daemon.
        if (folder / "state" / "daemon.json").exists():
            stop = [command, "daemon", "--stop"]
            subprocess.run(stop, env=os.environ | around, capture_output=True, check=False)


def _copy_campaigns(folder):
    """Copy the campaigns of the tutorial with fewer repeats, and with a pilot that needs no ROS."""
    for part in ("demo", "ortega2024", "robots", "suts"):
        shutil.copytree(ROOT / "campaigns" / part, folder / part)
    for name, repeats in (("demo/campaign.yaml", 2), ("ortega2024/swinging_doors.yaml", 1)):
        text = (folder / name).read_text()
        text = re.sub(r"^repeats: \d+", f"repeats: {repeats}", text, flags=re.M)
        text = re.sub(r"sut: \[a2s[^]]*\]", "sut: [pilot]", text)
        (folder / name).write_text(text.replace(" sut: fro-diff,", ""))


_QUICK = "courier"
"""The mission of the demo."""
PACE = 6.0
"""Simulated seconds in a second."""


def execute(
    spec, scene, *, trace_path, on_progress=None, interest=None, leads=False, judgements=None
):
    """Do what :func:`daemon.run.execute` does."""
    if interest is not None and spec.mission.name != _QUICK:
        interest = _paced(interest)
    return run.execute(
        spec, scene, trace_path=trace_path, on_progress=on_progress, interest=interest,
        leads=leads, judgements=judgements,
    )  # fmt: skip


def _paced(interest):
    """Let time pass between two questions whether anybody is interested."""
    began, asked = time.monotonic(), itertools.count()

    def paced():
        due = began + next(asked) / (WATCHED_RATE * PACE)
        time.sleep(max(due - time.monotonic(), 0.0))
        return interest()

    return paced
