"""The local worker: the same code as a remote one, in a process the daemon looks after."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from typing import Final

from daemon.executor import Limits
from daemon.kernels import kernel_environment
from daemon.places import Places
from daemon.server._journal import Journal

_FIRST_PAUSE: Final = 0.1
_LONGEST_PAUSE: Final = 10.0
_STEADY: Final = 30.0
_LARGEST_LOG: Final = 4 * 2**20
_LAST_WORDS: Final = 2000
_SETTLED: Final = 5.0


class LocalWorker:
    """Starts the worker, starts it again when it dies, and ends it.

    ``trouble`` holds its last words from its death until a new one has settled.
    """

    def __init__(
        self,
        places: Places,
        journal: Journal,
        *,
        endpoint: str,
        slots: int,
        executor: str,
        limits: Limits,
        tether: bool,
    ) -> None:
        self._places = places
        self._journal = journal
        self._tether = tether
        self._command = [sys.executable, "-m", "daemon", "worker", "--connect", endpoint]
        self._command += ["--slots", str(slots), "--executor", executor]
        self._command += ["--wall", str(limits.wall), "--memory", str(limits.memory)]
        self._command += ["--nice", str(limits.nice)]
        self._command += ["--parent", str(os.getpid())] + (["--tether"] if tether else [])
        self._process: subprocess.Popen[bytes] | None = None
        self._started = 0.0
        self._pause = _FIRST_PAUSE
        self._next_start = 0.0
        self._log_start = 0
        self.trouble = ""

    def look_after(self) -> None:
        """Start the worker unless it runs or has just died; call this every now and then."""
        now = time.monotonic()
        if self.trouble and now - self._started > _SETTLED and self.alive:
            self.trouble = ""
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                self._rotate()
                return
            self._process = None
            steady = now - self._started > _STEADY
            self._pause = _FIRST_PAUSE if steady else min(2 * self._pause, _LONGEST_PAUSE)
            self._next_start = now + self._pause
            self.trouble = self._last_words(code)
            self._journal.write(
                "local worker ended", code=code, restart_in=self._pause, words=self.trouble
            )
        if now >= self._next_start:
            self._start(now)

    def _rotate(self) -> None:
        """Put a log aside that has grown; the worker goes on at the beginning of the file.

        What it writes in that very moment is lost.
        """
        log = self._places.worker_log
        with suppress(FileNotFoundError):
            if log.stat().st_size > _LARGEST_LOG:
                shutil.copyfile(log, log.with_suffix(".log.1"))
                os.truncate(log, 0)
                self._log_start = 0

    def _start(self, now: float) -> None:
        self._rotate()
        log = self._places.worker_log
        with log.open("ab") as output:
            self._log_start = output.tell()
            self._process = subprocess.Popen(
                self._command,
                # A tethered daemon's standard input is the tether: both see its end.
                stdin=None if self._tether else subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                env=kernel_environment(self._places),
            )
        self._started = now
        self._journal.write("local worker started", pid=self._process.pid)

    def _last_words(self, code: int) -> str:
        with self._places.worker_log.open("rb") as log:
            log.seek(self._log_start)
            words = log.read().decode("utf-8", "replace").strip()
        return words[-_LAST_WORDS:] or f"the worker ended with code {code}"

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    def signal(self, number: signal.Signals) -> None:
        """Pass a signal on: SIGTERM finishes runs, SIGQUIT gives them back."""
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
