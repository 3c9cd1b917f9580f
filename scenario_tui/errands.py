"""What takes long and is not the daemon's to do: checking files, judging, making reports.

Each errand has a thread of its own. What comes of it waits until the thread that draws asks, so
that nothing touches the screen from elsewhere, also while it is being taken down.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from daemon.errors import DaemonError
from grammars.diagnostics import InputError

T = TypeVar("T")

Problem = Callable[[str], None]


class Errands:
    """Runs errands; :meth:`settle` passes on what came of them."""

    def __init__(self) -> None:
        self._done: deque[Callable[[], None]] = deque()

    def start(self, work: Callable[[], T], then: Callable[[T], None], otherwise: Problem) -> None:
        """Have ``work`` done by another thread; ``then`` takes what it returns.

        ``otherwise`` is told why it could not be done. Both are called by :meth:`settle`.
        """
        # Nobody waits for an errand who leaves the dashboard.
        errand = partial(self._run, work, then, otherwise)
        threading.Thread(target=errand, name="errand", daemon=True).start()

    def settle(self) -> bool:
        """Pass on what was done since; return whether there was something.

        A bug in an errand is raised here, where it is seen.
        """
        waiting = len(self._done)
        for _ in range(waiting):
            self._done.popleft()()
        return waiting > 0

    def _run(self, work: Callable[[], T], then: Callable[[T], None], otherwise: Problem) -> None:
        try:
            found = work()
        except (InputError, DaemonError) as error:
            self._done.append(partial(otherwise, str(error)))
        except OSError as error:
            where = f": {error.filename}" if error.filename else ""
            self._done.append(partial(otherwise, f"{error.strerror or error}{where}"))
        except Exception as error:
            self._done.append(partial(_raise, error))
        else:
            self._done.append(partial(then, found))


def _raise(error: Exception) -> None:
    raise error
