"""Daemons and workers of tests, forked from a process that has loaded what they need.

To load it takes each of them 0.4 CPU s, as it does a daemon's own worker and the zygote of each
worker: most of what they do in a test, and tests start about a hundred. What is forked is not
initialised: modules are in memory, ``python -m daemon`` runs as it does elsewhere, in a session and
with an environment and output of its own. What a part starts first, it starts like this too. What
starts by itself (``scenario daemon``), what is started again, and parts for which Python itself is
set up otherwise load everything.
"""

import atexit
import fcntl
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import SimpleNamespace

_LARGEST = 2**20
"""Bytes of the largest command line and its environment."""
_PID_BYTES = 8
"""More than the number of any process has; what comes behind is the exit code."""


class _ForkedProcess:
    """What tests and parts use of ``subprocess.Popen``; :meth:`_look` gives the exit code."""

    def poll(self):
        """The exit code, minus the signal's number; ``None`` while it runs."""
        return self._look(0.0)

    def wait(self, timeout=None):
        """Wait for the exit code; raises ``subprocess.TimeoutExpired``."""
        code = self._look(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(["daemon"], timeout)
        return code

    def send_signal(self, number):
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)


class PreparedProcess(_ForkedProcess):
    """A part, as its test sees it."""

    def __init__(self, ended):
        self._ended = ended
        self._code = None
        self._taking = threading.Lock()
        self.pid = int(os.read(ended, _PID_BYTES))

    def _look(self, timeout):
        if self._code is None and select.select([self._ended], [], [], timeout)[0]:
            with self._taking:
                if self._code is None:
                    # Nothing comes when who waited for it was killed with it.
                    self._code = int(os.read(self._ended, 20) or -signal.SIGKILL)
        return self._code

    def __del__(self):
        os.close(self._ended)


def start_prepared(words, root, output, stdin=None):
    """Run ``python -m WORDS`` in the folder ``root``; ``None`` where Python is set up otherwise."""
    environment = dict(os.environ)
    if _of_python(environment) != ENVIRONMENT:
        return None
    server = _server(root)
    ended, write_end = os.pipe()
    message = json.dumps([list(words), environment, _umask()]).encode()
    files = [write_end, output] if stdin is None else [write_end, output, stdin]
    socket.send_fds(server, [message], files)
    os.close(write_end)
    return PreparedProcess(ended)


def start_as_launched(command, root, *, stdin, stdout, stderr, start_new_session):
    """What ``subprocess.Popen`` does for who launches a daemon, as a part that was forked."""
    assert stdout == stderr
    assert start_new_session
    if stdin != subprocess.PIPE:
        return start_prepared(command[4:], root, stdout.fileno(), stdin if stdin >= 0 else None)
    reading, writing = os.pipe()
    process = start_prepared(command[4:], root, stdout.fileno(), reading)
    os.close(reading)
    process.stdin = os.fdopen(writing, "wb", 0)
    return process


def _umask():
    umask = os.umask(0o077)
    os.umask(umask)
    return umask


def _of_python(environment):
    return {
        name: value for name, value in environment.items() if name.startswith(("PYTHON", "LD_"))
    }


ENVIRONMENT = _of_python(os.environ)
"""Variables that Python or the loader has read when what is forked starts."""


@cache
def _server(root):
    """The process to fork from, which ends with this one."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    here.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _LARGEST)
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
    from daemon.batch.zygote import _load
    from daemon.model.verbs import VERBS
    from grammars.text import codec

    _load("tests.fake_run:execute")
    for verb in VERBS.values():
        codec.warm_up(verb.request, verb.answer)
        with suppress(ValueError):  # the validator is built
            codec.from_json(verb.request, b"", exactly=True)
    del sys.modules["daemon.batch.zygote"]  # it is run as a program
    threads = len(list(Path("/proc/self/task").iterdir()))
    assert threads == 1, "what is forked from a process with threads may hang"
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        message, files, _, _ = socket.recv_fds(asked, _LARGEST, 3)
        if not message:
            return
        if os.fork() == 0:
            asked.close()
            _start(*json.loads(message), *files)
            return
        for file in files:
            os.close(file)


def _start(words, environment, umask, ended, output, stdin=None):
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    part = os.fork()
    if part:
        os.write(ended, f"{part:{_PID_BYTES}}".encode())
        os.closerange(output, (stdin or output) + 1)
        _, status = os.waitpid(part, 0)
        os.write(ended, f"{os.waitstatus_to_exitcode(status)}\n".encode())
        os._exit(0)
    os.close(ended)
    os.setsid()
    os.umask(umask)
    os.dup2(output, sys.stdout.fileno())
    os.dup2(output, sys.stderr.fileno())
    os.close(output)
    if stdin is not None:
        os.dup2(stdin, 0)
        os.close(stdin)
    _become(words, environment)


def _become(words, environment):
    """Run ``python -m WORDS``; what that starts first is forked before it has threads."""
    os.environ.clear()
    os.environ.update(environment)
    module, *arguments = words
    sys.argv[1:] = arguments
    if starter := _starter(*words):
        prepared = [_PreparedChild()]

        def start(command, **how):
            if not prepared:
                return subprocess.Popen(command, **how)
            prepared[0].start(command, **how)
            return prepared.pop()

        starter.subprocess = SimpleNamespace(**vars(subprocess) | {"Popen": start})
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    sys.exit()


def _starter(module, *arguments):
    """The module that has a part start a process in Python, if this one does."""
    from daemon.batch.server import _processes
    from daemon.batch.worker import _zygotes

    if module == "daemon.batch.zygote":
        return None
    process, order = arguments
    plain = json.loads(order)
    if process == "serve":
        return _processes if plain.get("slots") != 0 else None
    return _zygotes if "dask" not in plain else None


class _PreparedChild(_ForkedProcess):
    """A child that becomes what is to be started: forked early, it waits to be told."""

    def __init__(self):
        self._wire, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._code = None
        self.stdin = None
        self.pid = os.fork()
        if not self.pid:
            self._wire.close()
            _wait_for_start(theirs)
        theirs.close()

    def start(self, command, *, stdin=None, stdout=None, stderr=None, env=None, pass_fds=(), **how):
        """Have it become that: ``command`` is one of ``python_command("-m", ...)``."""
        assert how == {"start_new_session": True}
        files = {number: number for number in pass_fds}
        if stdin == subprocess.PIPE:
            files[0], writing = os.pipe()
            self.stdin = os.fdopen(writing, "wb", 0)
        else:
            assert stdin == subprocess.DEVNULL
            files[0] = os.open(os.devnull, os.O_RDONLY)
        files |= {n: file.fileno() for n, file in ((1, stdout), (2, stderr)) if file is not None}
        environment = dict(os.environ if env is None else env)
        message = json.dumps([command[4:], environment, _umask(), list(files)]).encode()
        with self._wire:
            socket.send_fds(self._wire, [message], list(files.values()))
        os.close(files[0])

    def _look(self, timeout):
        if self._code is None:
            ended = os.pidfd_open(self.pid)
            if select.select([ended], [], [], timeout)[0]:
                self._code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
            os.close(ended)
        return self._code


def _wait_for_start(wire):
    message, files, _, _ = socket.recv_fds(wire, _LARGEST, 8)
    wire.close()
    if not message:
        os._exit(0)  # its parent has ended, and started nothing
    words, environment, umask, numbers = json.loads(message)
    # None is where another one is to be.
    files = [fcntl.fcntl(file, fcntl.F_DUPFD, 100) for file in files]
    for file, number in zip(files, numbers, strict=True):
        os.dup2(file, number)
    os.setsid()
    os.umask(umask)
    _become(words, environment)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
