"""The daemon's own worker process."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Final

from daemon.batch.paths import STATE_VARIABLE, StatePaths
from daemon.batch.permissions import open_private_log
from daemon.batch.server._runtime import EventLog
from daemon.model.execution import python_command

# Seconds. The pause before a restart doubles after each early death, up to the longest; after a
# steady run the process restarts without delay.
_FIRST_PAUSE: Final = 0.1
_LONGEST_PAUSE: Final = 10.0
_STEADY: Final = 30.0
_SETTLED: Final = 5.0
_LARGEST_LOG: Final = 4 * 2**20
_LONGEST_TAIL: Final = 2000
"""Longest end of the log in the reason of a death [characters]."""


class LocalWorker:
    """The daemon's own worker, restarted when it dies; ``order`` are the parameters of ``work``.

    SIGTERM lets it finish its runs, SIGQUIT returns them. When the daemon dies it also finishes
    them; with a ``tether`` it exits at once. ``trouble`` has its last words from its death until a
    new process has settled.
    """

    def __init__(self, paths: StatePaths, log: EventLog, order: Mapping[str, object]) -> None:
        self._command = python_command("-m", "daemon", "worker", json.dumps(order))
        self._output = paths.worker_log
        self._log = log
        self._environment = os.environ | {STATE_VARIABLE: str(paths.state)}
        self._process: subprocess.Popen[bytes] | None = None
        self._started = 0.0
        self._pause = _FIRST_PAUSE
        self._next_start = 0.0
        self._log_start = 0
        self.trouble = ""

    def supervise(self) -> None:
        """Start it unless it runs or has just died; call this periodically."""
        now = time.monotonic()
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                if now - self._started > _SETTLED:
                    self.trouble = ""
                self._rotate()
                return
            self._end(self._process, code, now)
        if now >= self._next_start:
            try:
                self._start(now)
            except OSError as error:
                self._pause_until(now, steady=False)
                self.trouble = f"the local worker cannot be started: {error}"

    def _pause_until(self, now: float, *, steady: bool) -> None:
        self._pause = _FIRST_PAUSE if steady else min(2 * self._pause, _LONGEST_PAUSE)
        self._next_start = now + self._pause

    def _end(self, process: subprocess.Popen[bytes], code: int, now: float) -> None:
        assert process.stdin is not None
        process.stdin.close()
        self._process = None
        self._pause_until(now, steady=now - self._started > _STEADY)
        self.trouble = self._log_tail(code)
        self._log.write("local worker ended", code=code, restart_in=self._pause, words=self.trouble)

    def _rotate(self) -> None:
        """Rotate a large log; output during the rotation is lost."""
        # Copied and truncated, not renamed: the process and its children keep the file open in
        # append mode, and go on at its new end.
        with suppress(FileNotFoundError):
            if self._output.stat().st_size > _LARGEST_LOG:
                # On a full disk the old part is lost.
                with suppress(OSError):
                    shutil.copy(self._output, self._output.with_suffix(".log.1"))
                os.truncate(self._output, 0)
                self._log_start = 0

    def _start(self, now: float) -> None:
        self._rotate()
        with open_private_log(self._output) as output:
            self._log_start = output.seek(0, os.SEEK_END)
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,  # closes when the daemon is gone
                stdout=output,
                stderr=output,
                # Ctrl-C in the terminal is for the daemon, which ends the worker in order.
                start_new_session=True,
                env=self._environment,
            )
        self._started = now
        self._log.write("local worker started", pid=self._process.pid)

    def _log_tail(self, code: int) -> str:
        words = ""
        with suppress(FileNotFoundError), self._output.open("rb") as log:
            size = log.seek(0, os.SEEK_END)
            log.seek(max(self._log_start, size - 4 * _LONGEST_TAIL))
            words = log.read().decode("utf-8", "replace").strip()
        return words[-_LONGEST_TAIL:] or f"the local worker ended with code {code}"

    @property
    def pid(self) -> int:
        """The id of the process, 0 without one."""
        return 0 if self._process is None else self._process.pid

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the process, if it runs."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(number)

    def wait(self, seconds: float) -> bool:
        """Wait for the end of the process; return whether it has ended."""
        if self._process is None:
            return True
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True
