"""Stacks in folders of their own, and an engine of containers that a script pretends to be."""

import json
import os
import tempfile
from pathlib import Path

import pytest

from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import Ros2Settings
from tests.stacks.ros2.holder import QUIET_RELAY
from tests.stacks.ros2.parts.started import PYTHON


@pytest.fixture(autouse=True)
def temporary(monkeypatch, tmp_path_factory):
    """Folders of stacks that no other test and no daemon sees."""
    tmp_path_factory.getbasetemp()  # chosen now, not once there is another folder for it
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        monkeypatch.setattr("tempfile.tempdir", folder)
        monkeypatch.setenv("TMPDIR", folder)
        yield Path(folder)


@pytest.fixture
def start(temporary):
    """Start a stack; what is not released is ended after the test."""
    started = []

    def start_stack(launch="sleep 600", *, begin=True, **more):
        own = {name: more.pop(name) for name in ("relay", "grace") if name in more}
        keys = {"launch": launch} if launch else {}
        settings = Ros2Settings.model_validate(keys | {"python": "sh"} | more)
        stack = StackProcess(settings, **{"values": {}, "relay": QUIET_RELAY} | own)
        started.append(stack)
        if begin:
            stack.start()
        return stack

    yield start_stack
    for stack in started:
        stack.release()


ENGINE = """#!{python} -IS
import json, os, signal, subprocess, sys
here = {folder!r}
with open(here + "/calls", "a") as calls:
    calls.write(json.dumps(sys.argv[1:]) + "\\n")
verb, rest = sys.argv[1], sys.argv[2:]
if verb == "image":
    known = rest[-1] == "my/nav2:1.4"
    print('["sh", "-c", "echo own command; sleep 600"]' if known else "", flush=True)
    sys.exit(0 if known else "Error: no such image")
if verb in ("kill", "rm"):
    try:
        group = int(open(f"{{here}}/{{rest[-1]}}").read())
        os.killpg(group, signal.SIGKILL)
    except (OSError, ValueError):
        sys.exit("no such container")
    sys.exit(0)
assert verb == "run"
options = iter(rest)
environment = {{"PATH": os.environ["PATH"]}}
told = {{}}
for word in options:
    if word in ("--rm", "--init"):
        continue
    if not word.startswith("--"):
        image = word
        break
    told[word] = next(options)
    if word == "--env":
        environment.update([told[word].split("=", 1)])
inside = subprocess.Popen(
    list(options), env=environment, cwd=told["--workdir"], start_new_session=True
)
open(here + "/" + told["--name"], "w").write(str(inside.pid))
for number in (signal.SIGINT, signal.SIGTERM):
    ignore = "ignores" in image
    signal.signal(number, signal.SIG_IGN if ignore else lambda n, _: os.kill(inside.pid, n))
sys.exit(inside.wait())
"""


@pytest.fixture
def engine(tmp_path, monkeypatch):
    """Put an engine on the path; returns what it was told."""
    place = tmp_path / "engine"
    place.mkdir()
    for name in ("podman", "docker"):
        (place / name).write_text(ENGINE.format(python=PYTHON, folder=str(place)))
        (place / name).chmod(0o755)
    (place / "calls").touch()
    monkeypatch.setenv("PATH", f"{place}:{os.environ['PATH']}")
    return lambda: [json.loads(line) for line in (place / "calls").read_text().splitlines()]
