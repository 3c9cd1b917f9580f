"""Files that stacks are started with, and what is seen of their processes."""

import secrets
import sys

import psutil

from daemon.stacks.ros2.isolation import DomainTaken, lock_domain
from tests.parts import eventually
from tests.stacks.ros2.holder import marked

PYTHON = sys.executable


def program(folder, text, name="program.py"):
    path = folder / name
    path.write_text(text)
    return f"{PYTHON} -IS {path}"


def relay_file(folder, text="import time\nprint('here')\ntime.sleep(600)\n"):
    path = folder / "relay.py"
    path.write_text(text)
    return path


def setup_file(folder, text):
    path = folder / "setup.bash"
    path.write_text(text)
    return {"setup": str(path)}


def printed(stack, text):
    """Wait until the stack has printed something."""
    eventually(lambda: text.encode() in stack.outputs()["stack.txt"])


def nothing_left(stack):
    assert marked(stack.folder.name) == []
    assert not stack.folder.exists()
    eventually(lambda: is_free(stack.domain))


def is_free(domain):
    try:
        lock_domain(domain)[1].close()
    except DomainTaken:
        return False
    return True


def own_seconds():
    """A time to sleep by which a process is known from those of other suites on this machine."""
    return f"601.{secrets.randbelow(10**9):09d}"


def sleepers(seconds, name="sleep"):
    return [p for p in psutil.process_iter(["cmdline"]) if p.info["cmdline"] == [name, seconds]]
