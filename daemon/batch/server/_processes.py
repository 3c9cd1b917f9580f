"""The process the daemon keeps: its own worker."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from dataclasses import asdict
from typing import Final

from daemon.batch.paths import STATE_VARIABLE, StatePaths
from daemon.batch.permissions import open_private_log
from daemon.batch.server._runtime import EventLog
from daemon.model.execution import RunLimits, python_command

# Seconds. A process that dies at once is started again after twice the time, up to the longest; one
# that ran steadily died of something new and is started without delay.
_FIRST_PAUSE: Final = 0.1
_LONGEST_PAUSE: Final = 10.0
_STEADY: Final = 30.0
_SETTLED: Final = 5.0
_LARGEST_LOG: Final = 4 * 2**20
_LONGEST_TAIL: Final = 2000
"""Characters of the log that say why a process died."""


class LocalWorker:
    """The daemon's own worker: started, and started again when it dies.

    SIGTERM lets it finish its runs, SIGQUIT gives them back. When the daemon dies it finishes them
    too; one of a daemon with a ``tether`` exits at once. ``trouble`` holds its last words from its
    death until a new one has settled.
    """

    def __init__(
        self,
        paths: StatePaths,
        log: EventLog,
        *,
        endpoint: str,
        slots: int,
        executor: str,
        limits: RunLimits,
        tether: bool,
    ) -> None:
        order = {
            "connect": endpoint,
            "slots": slots,
            "executor": executor,
            "limits": asdict(limits),
            "tether": "exit" if tether else "finish",
        }
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
        """Start it unless it runs or has just died; call this every now and then."""
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
        """Put a log aside that has grown; the process goes on at the beginning of the file.

        What it writes in that very moment is lost.
        """
        # Copied and cut off, not renamed: the process and its children keep writing to the open
        # file, in append mode, so that they go on at its new end.
        with suppress(FileNotFoundError):
            if self._output.stat().st_size > _LARGEST_LOG:
                # On a full disk what was said before is not kept.
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
                stdin=subprocess.PIPE,  # its end tells that the daemon is gone
                stdout=output,
                stderr=output,
                # Ctrl-C in the daemon's terminal is for the daemon, which ends it in order.
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
        """The number of the process, 0 while there is none."""
        return 0 if self._process is None else self._process.pid

    def signal(self, number: signal.Signals) -> None:
        """Pass a signal on, if it runs."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(number)

    def wait(self, seconds: float) -> bool:
        """Wait for the end of the process; returns whether it came."""
        if self._process is None:
            return True
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True
