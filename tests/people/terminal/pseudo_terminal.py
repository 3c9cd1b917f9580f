"""A program in a real pseudo-terminal: type, read the screen, resize, count the bytes."""

import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import sys
import termios
import threading
import time
from pathlib import Path

import pyte

ROOT = Path(__file__).parents[3]
DEADLINE = 120.0
"""Seconds in which nothing happens, after which a test is broken, and not the machine busy."""
_NUMBERS = re.compile(r"[\d.]+")
ALTERNATE, MOUSE, PASTE = 1049, (1000, 1002, 1003, 1006, 1015), 2004
_PRIVATE = 5
"""How far pyte shifts the numbers of private modes."""
_KEPT = ("PATH", "VIRTUAL_ENV", "PYTHONPATH")


class Terminal:
    """A terminal of ``columns`` x ``rows`` with a program in it; ``sent`` counts its bytes."""

    def __init__(self, pid, master, columns, rows):
        self.pid, self._master = pid, master
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self.screen)
        self.sent = 0
        self.raw = bytearray()
        self._code = None
        self._lines = None

    @property
    def lines(self):
        """What a reader sees."""
        # Putting them together takes milliseconds, and who waits for something asks for them fifty
        # times a second: that was most of the time of the tests in terminals.
        if self._lines is None:
            self._lines = [line.rstrip() for line in self.screen.display]
        return self._lines

    @property
    def text(self):
        return "\n".join(self.lines)

    def mode(self, number):
        """Whether a private mode is set: ``CSI ? number h``."""
        return number << _PRIVATE in self.screen.mode

    def read(self, seconds):
        """Take in what comes, for that long at most and until there is a pause of a tenth."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            ready, _, _ = select.select([self._master], [], [], min(left, 0.1))
            if ready and not self._take():
                return

    def _take(self):
        try:
            data = os.read(self._master, 65536)
        except OSError:  # Linux says EIO when the program has left
            return False
        self.sent += len(data)
        self.raw += data
        self._stream.feed(data)
        self._lines = None
        return bool(data)

    def until(self, seen):
        """Read until some text is on the screen, or something else is true.

        Runs that one waits for may take long beside others: as long as something but numbers
        changes, which are ages too, it is waited for.
        """
        true = seen if callable(seen) else lambda: seen in self.text
        before, deadline = "", time.monotonic() + DEADLINE
        while not true():
            now = _NUMBERS.sub("", self.text)
            if now != before:
                before, deadline = now, time.monotonic() + DEADLINE
            assert time.monotonic() < deadline, f"not in time: {seen!r}\n{self.text}"
            self.read(0.02)

    def type(self, keys):
        """Press keys."""
        os.write(self._master, keys.encode())

    def resize(self, columns, rows):
        """Change the size, as dragging the window does; the program gets SIGWINCH."""
        _set_size(self._master, columns, rows)
        self.screen.resize(rows, columns)
        self._lines = None
        os.kill(self.pid, signal.SIGWINCH)

    def clear(self):
        """Forget what is on the screen, and how it was set, as a terminal does that is reset."""
        self.screen.reset()
        self._lines = None

    def wait(self, seconds=DEADLINE):
        """Read until the program has left; returns its exit code, minus the signal's number.

        What it said last is read then, however late: nobody else writes to this terminal.
        """
        deadline = time.monotonic() + seconds
        while self._code is None:
            self.read(0.02)
            done, status = os.waitpid(self.pid, os.WNOHANG)
            if done:
                self._code = os.waitstatus_to_exitcode(status)
            assert time.monotonic() < deadline, f"still there:\n{self.text}"
        while self._take():
            pass
        return self._code

    def hang_up(self):
        """Close the terminal, as closing its window does; returns the exit code of the program."""
        os.close(self._master)
        self._master = os.open(os.devnull, os.O_RDWR)
        return self.wait()

    def stopped(self):
        """Whether the program was suspended since this was last asked."""
        done, status = os.waitpid(self.pid, os.WNOHANG | os.WUNTRACED)
        return bool(done) and os.WIFSTOPPED(status)

    def close(self):
        if self._code is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
        os.close(self._master)


def typed_here(call, *, columns=100, rows=40):
    """Call something of this process whose output goes to a terminal; return its code, the bytes.

    Standard input stays what it is: nothing is drawn that somebody would have to leave by a key.
    """
    master, slave = pty.openpty()
    _set_size(slave, columns, rows)
    raw = bytearray()

    def take():
        with contextlib.suppress(OSError):  # Linux says EIO when nobody writes any more
            while data := os.read(master, 65536):
                raw.extend(data)

    reader = threading.Thread(target=take)
    reader.start()
    try:
        with (
            open(slave, "w", encoding="utf-8", buffering=1) as stream,  # noqa: PTH123
            contextlib.redirect_stdout(stream),
            contextlib.redirect_stderr(stream),
        ):
            code = call()
    finally:
        reader.join()
        os.close(master)
    return code, bytes(raw)


def _set_size(descriptor, columns, rows):
    fcntl.ioctl(descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))


@contextlib.contextmanager
def terminal(command, *, columns=80, rows=24, environ=None):
    """Run a command in a terminal of its own; nothing of it is left afterwards."""
    around = {name: os.environ[name] for name in _KEPT if name in os.environ}
    # Nobody's settings are to be read.
    around |= {"HOME": "/nowhere", "TERM": "xterm-256color", "LANG": "C.UTF-8", **(environ or {})}
    master, slave = pty.openpty()
    _set_size(slave, columns, rows)
    pid = _spawn(list(command), os.ttyname(slave), around)
    os.close(slave)
    shown = Terminal(pid, master, columns, rows)
    try:
        yield shown
    finally:
        shown.close()


def _spawn(command, tty, environ):
    """Start a command; the terminal that a leader of a session opens first is the one it has."""
    actions = [
        (os.POSIX_SPAWN_OPEN, 0, tty, os.O_RDWR, 0),
        (os.POSIX_SPAWN_DUP2, 0, 1),
        (os.POSIX_SPAWN_DUP2, 0, 2),
    ]
    return os.posix_spawn(command[0], command, environ, file_actions=actions, setsid=True)


def scenario(*arguments):
    """The command line of this working copy."""
    return [sys.executable, "-c", "from scenario_tui.cli import main; main()", *arguments]
