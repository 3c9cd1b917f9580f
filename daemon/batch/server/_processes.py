"""The process the daemon keeps: its own worker."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from daemon.batch.numba_cache import numba_cache_environment
from daemon.batch.paths import StatePaths
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


class KeptProcess:
    """Starts a process, starts it again when it dies, and ends it.

    ``name`` is what messages call it, ``output`` the file of what it writes, and ``stdin`` as
    :class:`subprocess.Popen` has it. ``trouble`` holds its last words from its death until a new
    one has settled.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        output: Path,
        log: EventLog,
        *,
        environment: Mapping[str, str] | None,
        stdin: int | None,
    ) -> None:
        self._name = name
        self._command = tuple(command)
        self._output = output
        self._log = log
        self._environment = environment
        self._stdin = stdin
        self._process: subprocess.Popen[bytes] | None = None
        self._started = 0.0
        self._pause = _FIRST_PAUSE
        self._next_start = 0.0
        self._log_start = 0
        self.trouble = ""

    def supervise(self, *, wanted: bool = True) -> None:
        """Start it, if ``wanted``, unless it runs or has just died; call this every now and then.

        One that is not wanted any more ends by itself.
        """
        now = time.monotonic()
        if self.trouble and now - self._started > _SETTLED and (self.alive or not wanted):
            self.trouble = ""
        if self._process is not None:
            code = self._process.poll()
            if code is None:
                self._rotate()
                return
            self._end(code, now)
        if wanted and now >= self._next_start:
            try:
                self._start(now)
            except OSError as error:
                self._pause = min(2 * self._pause, _LONGEST_PAUSE)
                self._next_start = now + self._pause
                self.trouble = f"the {self._name} cannot be started: {error}"

    def _end(self, code: int, now: float) -> None:
        process, self._process = self._process, None
        if process is not None and process.stdin is not None:
            process.stdin.close()
        steady = now - self._started > _STEADY
        self._pause = _FIRST_PAUSE if steady else min(2 * self._pause, _LONGEST_PAUSE)
        self._next_start = now + self._pause
        self.trouble = self._log_tail(code)
        self._log.write(
            f"{self._name} ended", code=code, restart_in=self._pause, words=self.trouble
        )

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
                stdin=self._stdin,
                stdout=output,
                stderr=output,
                # Ctrl-C in the daemon's terminal is for the daemon, which ends it in order.
                start_new_session=True,
                env=self._environment,
            )
        self._started = now
        self._log.write(f"{self._name} started", pid=self._process.pid)

    def _log_tail(self, code: int) -> str:
        words = ""
        with suppress(FileNotFoundError), self._output.open("rb") as log:
            size = log.seek(0, os.SEEK_END)
            log.seek(max(self._log_start, size - 4 * _LONGEST_TAIL))
            words = log.read().decode("utf-8", "replace").strip()
        return words[-_LONGEST_TAIL:] or f"the {self._name} ended with code {code}"

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

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


class LocalWorker(KeptProcess):
    """The daemon's own worker: SIGTERM lets it finish its runs, SIGQUIT gives them back."""

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
        command = python_command("-m", "daemon", "worker", "--connect", endpoint)
        command += ["--slots", str(slots), "--executor", executor]
        command += ["--wall", str(limits.wall), "--memory", str(limits.memory)]
        command += ["--nice", str(limits.nice)]
        command += ["--parent", str(os.getpid())] + (["--tether"] if tether else [])
        super().__init__(
            "local worker",
            command,
            paths.worker_log,
            log,
            environment=numba_cache_environment(paths),
            # A tethered daemon's standard input is the tether: both see its end.
            stdin=None if tether else subprocess.DEVNULL,
        )
