"""Holds a stack in a process of its own, as that of a run does, so that it can be killed.

``python -m tests.stacks.ros2.holder '{"launch": ...}'``: prints a line of JSON once the
stack has been started, then does what a line of standard input says: ``end``.
"""

import json
import os
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import psutil

from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import Ros2Settings

QUIET_RELAY = Path(__file__).with_name("quiet_relay.sh")
"""A relay for the "python" that is a shell: one that is interrupted says nothing of it."""


def marked(token):
    """Everything that runs and has the marker of a stack in its environment.

    A process that is just replacing its program has no environment to be read, and is missing.
    """
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("SCENARIO_STACK") == token:
                found.append(process)
        except psutil.Error:
            continue
    return found


def supervisor_of(folder):
    """The supervisor whose stack lives in a folder: the parent of the stack's shell."""
    for process in psutil.process_iter():
        try:
            if process.cwd() == str(folder) and "supervision.supervisor" in process.cmdline()[4]:
                return process
        except (psutil.Error, IndexError):
            continue
    raise AssertionError("there is no supervisor")


@contextmanager
def holder(**what):
    """A process that holds a stack, and what it has told of it."""
    words = [sys.executable, "-m", "tests.stacks.ros2.holder", json.dumps(what)]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            yield process, json.loads(process.stdout.readline())
        finally:
            process.kill()


def hold(what):
    if what.pop("as_run", False):
        # As daemon.batch.run_process does it to the process of a run.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, most))
        os.environ |= {"PYTHONSAFEPATH": "1", "SCENARIO_STATE": "/nowhere"}
    relay = Path(what.pop("relay", QUIET_RELAY))
    settings = Ros2Settings.model_validate({"python": "sh"} | what)
    stack = StackProcess(settings, values={}, relay=relay)
    stack.start()
    print(json.dumps({"folder": str(stack.folder), "domain": stack.domain}), flush=True)
    for line in sys.stdin:
        if line.strip() == "end":
            stack.release()
            print(json.dumps([data.decode() for data in stack.outputs().values()]), flush=True)


if __name__ == "__main__":
    hold(json.loads(sys.argv[1]))
