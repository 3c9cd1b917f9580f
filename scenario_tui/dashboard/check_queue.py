"""Campaign files checked in the background, and checked again when they are edited."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from grammars.text.diagnostics import Diagnostic, Where
from scenario_tui.campaign_files import newest_change
from scenario_tui.dashboard.background import BackgroundTasks
from scenario_tui.submission import CheckedFile, FileChecker

_AT_ONCE: Final = 2
"""Files checked at a time: one that takes long, and the one looked at. Every check is a process of
100 MB, and who holds a cursor key passes by many files.
"""


class CheckQueue:
    """What is known of files; ``on_checked`` is called when there is more to know.

    A check says as of when it is true: the newest change of anything in the folder, because
    campaigns name robots, floor plans and oracles that lie beside them.
    """

    def __init__(
        self, tasks: BackgroundTasks, check_file: FileChecker, on_checked: Callable[[], None]
    ) -> None:
        self._tasks, self._check_file, self._on_checked = tasks, check_file, on_checked
        self._checked: dict[Path, tuple[float, CheckedFile]] = {}
        self._checking: set[Path] = set()

    def found(self, path: Path) -> CheckedFile | None:
        """Return what was found of a file, if it was checked."""
        return self._checked[path][1] if path in self._checked else None

    def check(self, path: Path) -> None:
        """Check a file, unless that was done, or enough of them are being checked."""
        if path in self._checked or path in self._checking or len(self._checking) >= _AT_ONCE:
            return
        self._checking.add(path)
        self._tasks.start(
            partial(self._check_now, path), partial(self._note, path), partial(self._fail, path)
        )

    def forget(self, path: Path) -> None:
        """Know nothing of a file any more."""
        self._checked.pop(path, None)

    def look_again(self, path: Path) -> None:
        """Check a file again if it was edited since, or one beside it."""
        if path in self._checked:
            self._tasks.start(
                partial(newest_change, path.parent),
                partial(self._note_change, path),
                partial(self._fail, path),
            )

    def _check_now(self, path: Path) -> tuple[float, CheckedFile]:
        # The time first: what is saved while the check goes on makes it out of date.
        return newest_change(path.parent), self._check_file(path)

    def _note_change(self, path: Path, changed: float) -> None:
        # What was found before stays on the screen until the next check is done: no flicker.
        if path in self._checked and changed > self._checked[path][0]:
            del self._checked[path]
            self.check(path)

    def _fail(self, path: Path, why: str) -> None:
        found = CheckedFile("", (Diagnostic(Where(str(path)), why),))
        self._note(path, (time.time(), found))

    def _note(self, path: Path, found: tuple[float, CheckedFile]) -> None:
        self._checking.discard(path)
        self._checked[path] = found
        self._on_checked()
