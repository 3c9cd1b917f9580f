"""Daemons and workers of tests, forked from a process that has loaded what they need.

To load it takes each of them 0.3 CPU s, most of what the others do in a test, and tests start about
a hundred. What is forked is not initialised: modules are in memory, ``python -m daemon`` runs as
it does elsewhere, in a session and with an environment and output of its own. What starts by
itself (``scenario daemon``, the workers of a daemon, zygotes) loads everything, as do parts in
another environment than the one in which the tests were read.
"""

import atexit
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
from functools import cache
from pathlib import Path

_LARGEST = 65536
"""Bytes of the largest command line."""
_PID_BYTES = 8
"""More than the number of any process has; what comes behind is the exit code."""
_OF_THE_TEST = "PYTEST_CURRENT_TEST"


class PreparedProcess:
    """A part that was forked: what tests use of ``subprocess.Popen``."""

    def __init__(self, ended):
        self._ended = ended
        self._code = None
        self.pid = int(os.read(ended, _PID_BYTES))

    def poll(self):
        """The exit code, minus the signal's number; ``None`` while it runs."""
        return self._look(0.0)

    def wait(self, timeout=None):
        """Wait for the exit code; raises ``subprocess.TimeoutExpired``."""
        code = self._look(timeout)
        if code is None:
            assert timeout is not None
            raise subprocess.TimeoutExpired(["daemon"], timeout)
        return code

    def send_signal(self, number):
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)

    def _look(self, timeout):
        if self._code is None and select.select([self._ended], [], [], timeout)[0]:
            # Nothing comes when who waited for it was killed with it.
            self._code = int(os.read(self._ended, 20) or -signal.SIGKILL)
            os.close(self._ended)
        return self._code


def start_prepared(words, root, output):
    """Run ``python -m daemon WORDS`` in the folder ``root``; ``None`` in another environment."""
    if _environment() != ENVIRONMENT:
        return None
    server = _server(root)
    ended, write_end = os.pipe()
    message = json.dumps([list(words), os.environ.get(_OF_THE_TEST, "")]).encode()
    socket.send_fds(server, [message], [write_end, output])
    os.close(write_end)
    return PreparedProcess(ended)


def _environment():
    return {name: value for name, value in os.environ.items() if name != _OF_THE_TEST}


# When this is imported no test has begun: whichever part is the first may have one of its own.
ENVIRONMENT = _environment()
"""What is forked has this environment."""


@cache
def _server(root):
    """The process to fork from, which ends with this one."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with there:
        subprocess.Popen(
            [sys.executable, "-m", __name__, str(there.fileno())],
            cwd=root,
            stdin=subprocess.DEVNULL,
            pass_fds=[there.fileno()],
            start_new_session=True,
        ).returncode = 0  # nobody waits for it: it ends after this process
    atexit.register(here.close)
    return here


def _serve(asked):
    """Fork what is asked for; returns in the forked, and when nobody asks any more."""
    import daemon.batch.server
    import daemon.batch.worker  # noqa: F401

    threads = len(list(Path("/proc/self/task").iterdir()))
    assert threads == 1, "what is forked from a process with threads may hang"
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        message, files, _, _ = socket.recv_fds(asked, _LARGEST, 2)
        if not message:
            return
        if os.fork() == 0:
            asked.close()
            _run(*json.loads(message), *files)
            return
        for file in files:
            os.close(file)


def _run(words, test, ended, output):
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    part = os.fork()
    if part:
        os.write(ended, f"{part:{_PID_BYTES}}".encode())
        os.close(output)
        _, status = os.waitpid(part, 0)
        os.write(ended, f"{os.waitstatus_to_exitcode(status)}\n".encode())
        os._exit(0)
    os.close(ended)
    os.setsid()
    os.dup2(output, sys.stdout.fileno())
    os.dup2(output, sys.stderr.fileno())
    os.close(output)
    os.environ[_OF_THE_TEST] = test
    sys.argv[1:] = words
    runpy.run_module("daemon", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
