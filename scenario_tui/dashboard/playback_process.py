"""Traces made ready for looking at by a process of its own, which takes along what it needed.

Sampling signals loads what judges: numba, scipy and shapely, and what they keep. In the process of
the dashboard that would stay for as long as it is open: 245 MB with one run of the published
building, 120 with what the other process hands over. It starts when runs are shown and waits for
the next trace, because to read one takes 0.05 CPU s and to load what reads it 1.0; after a minute
without one it leaves.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, TypeAlias

from daemon.model.execution import python_command
from grammars.text.diagnostics import Finding, Where

if TYPE_CHECKING:
    from daemon.model.verdicts import Verdict
    from scenario_tui.dashboard.playback import Playback

PlaybackReader: TypeAlias = Callable[[Path, "Sequence[Verdict]"], "Playback"]
"""Reads a trace with the verdicts to be shown; raises as :func:`read_playback` does."""

IDLE: Final = 60.0
"""Seconds without a trace to read after which the process leaves."""


def read_playback(path: Path, verdicts: Sequence[Verdict]) -> Playback:
    """Read a trace and sample its signals here.

    Raises :class:`daemon.trace.TraceError` for what is no usable trace.
    """
    from scenario_tui.dashboard.playback import open_playback

    playback = open_playback(path, verdicts)
    playback.timeline  # noqa: B018  sampled here and not where it would be waited for
    return playback


class PlaybackProcess:
    """Reads traces in a child process, there from :meth:`begin` or the first one; any thread."""

    def __init__(self, idle: float = IDLE) -> None:
        self._idle = idle
        self._child: subprocess.Popen[bytes] | None = None
        self._turn = threading.Lock()

    def begin(self) -> None:
        """Have the process there, and what it needs loaded, before the first trace is asked for."""
        # Whoever asks for a trace just now starts it by that.
        if self._turn.acquire(blocking=False):
            try:
                if self._child is not None and self._child.poll() is not None:
                    self.close()
                if self._child is None:
                    self._child = _start(self._idle)
            finally:
                self._turn.release()

    def read(self, path: Path, verdicts: Sequence[Verdict]) -> Playback:
        """Return what :func:`read_playback` does."""
        from daemon.trace import TraceError

        with self._turn:
            found = self._ask(path, verdicts)
            if found is None:
                # It may just have left because there was nothing to do.
                self.close()
                found = self._ask(path, verdicts)
        if found is None:
            self.close()
            raise TraceError(path, "the process that reads it ended", "open the run again")
        if isinstance(found, Finding):
            raise TraceError(path, found.message, found.hint)
        return found

    def close(self) -> None:
        """Let the process leave; the next trace starts another one."""
        child, self._child = self._child, None
        if child is not None:
            with contextlib.suppress(BrokenPipeError):
                child.communicate()

    def _ask(self, path: Path, verdicts: Sequence[Verdict]) -> Playback | Finding | None:
        """Return the answer of the process, ``None`` when there is none."""
        if self._child is None:
            self._child = _start(self._idle)
        asked, told = self._child.stdin, self._child.stdout
        assert asked is not None
        assert told is not None
        try:
            pickle.dump((path, tuple(verdicts)), asked)
            asked.flush()
            answer: Playback | Finding = pickle.load(told)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            return None
        return answer


def _start(idle: float) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        python_command("-m", __name__, str(idle)),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # Oracles that plug in may say something, and the dashboard draws where that would go.
        stderr=subprocess.DEVNULL,
        # In a session of its own it does not hear Ctrl-C or that the terminal was closed.
        start_new_session=True,
    )


def main(arguments: list[str]) -> None:
    """Answer what standard input asks for until it ends or nothing is asked for a while."""
    # What prints must not do so into the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _load()
    with contextlib.suppress(EOFError, BrokenPipeError):
        while select.select([sys.stdin], [], [], float(arguments[0]))[0]:
            _answer(sys.stdin.buffer, answers)


def _load() -> None:
    """Load what reads traces and samples their signals: somebody is about to open a run."""
    import_module("scenario_tui.dashboard.playback")
    import_module("daemon.judging.oracles")
    import_module("daemon.judging.live")


def _answer(questions: IO[bytes], answers: IO[bytes]) -> None:
    from daemon.trace import TraceError

    path, verdicts = pickle.load(questions)
    found: Any
    try:
        found = read_playback(path, verdicts)
    except TraceError as error:
        found = error.findings[0]
    except Exception as error:
        # A bug, or an oracle that plugs in: said where it is seen, and the next trace is read.
        why = f"cannot be shown: {type(error).__name__}: {error}"
        found = Finding(Where(str(path)), why)
    pickle.dump(found, answers, pickle.HIGHEST_PROTOCOL)
    answers.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
