"""Holds a stack in a process of its own, as that of a run does, so that it can be killed.

``python -m tests.daemon.stacks.ros2.holder '{"launch": ...}'``: prints a line of JSON once the
stack has been started, then does what lines of standard input say: ``keep``, ``end``.
"""

import json
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil

from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import Ros2Settings
from daemon.supervision.guardian import guard

PATIENCE = 60.0
QUIET_RELAY = Path(__file__).with_name("quiet_relay.sh")
"""A relay for the "python" that is a shell: one that is interrupted says nothing of it."""


def eventually(condition, seconds=PATIENCE):
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)
    return value


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


def marked_without_relay(token):
    """What runs of the stack alone."""
    programs = [(p, _words(p)) for p in marked(token)]
    return [p for p, words in programs if words and not _is_quiet_relay(words)]


def _words(process):
    try:
        return process.cmdline()
    except psutil.NoSuchProcess:  # what a shell starts comes and goes
        return []


def _is_quiet_relay(words):
    # The shell that reads the file, and what it becomes.
    return words == ["sleep", "605"] or QUIET_RELAY.name in words[-1]


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
    words = [sys.executable, "-m", "tests.daemon.stacks.ros2.holder", json.dumps(what)]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            assert process.stdout is not None
            yield process, json.loads(process.stdout.readline())
        finally:
            process.kill()


def hold_once(what, wire):
    """What the process of a run does with a stack that is kept for its worker's next run."""
    guard()  # which leaves the supervisor of a stack alone, and nothing else
    settings = Ros2Settings(python="sh", **what)
    stack = StackProcess(settings, values={}, key="key", relay=QUIET_RELAY)
    stack.start()
    stack.release(keep=True)
    wire.send((stack.reused, str(stack.folder)))


def hold_in_runs(what, count):
    """As a worker does it, for which the processes of runs are forked by a server."""
    context = multiprocessing.get_context("forkserver")
    told = []
    for _ in range(count):
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=hold_once, args=(what, theirs))
        process.start()
        theirs.close()
        told.append(ours.recv())
        process.join()
    print(json.dumps({"stacks": told}), flush=True)
    sys.stdin.read()


def hold(what):
    if runs := what.pop("worker", 0):
        hold_in_runs(what, runs)
        return
    if what.pop("as_run", False):
        # As daemon.batch.run_process does it to the process of a run.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, most))
        os.environ |= {"PYTHONSAFEPATH": "1", "SCENARIO_STATE": "/nowhere"}
    keep, relay = what.pop("keep", False), Path(what.pop("relay", QUIET_RELAY))
    stack = StackProcess(Ros2Settings(**{"python": "sh"} | what), values={}, key="key", relay=relay)
    stack.start()
    told = {"folder": str(stack.folder), "reused": stack.reused, "domain": stack.domain}
    print(json.dumps(told), flush=True)
    if keep:
        stack.release(keep=True)
    for line in sys.stdin:
        if line.strip() == "end":
            stack.release(keep=False)
            print(json.dumps([data.decode() for data in stack.outputs().values()]), flush=True)


if __name__ == "__main__":
    hold(json.loads(sys.argv[1]))
