"""Lock step: the wait of a cycle for a stack, and the meaning of a missing answer.

There are three paces. *Free*: no command is expected, because no goal is active or the first
command has not come. The clock goes on after a short wait (as in PX4 until the first actuator
message). *Locked*: every cycle waits for its command, at most the patience. *Quiet*: after a cycle
without an answer the clock runs in real time until commands come again, because a stack that
replans or waits in a recovery may send no command for seconds. A stack that sends no message at
all for ten seconds hangs.
"""

from __future__ import annotations

from typing import Final, Literal

from daemon.model.sut import SutEvent, SutFailure
from daemon.stacks.ros2.link import CycleAnswer
from daemon.stacks.ros2.settings import Ros2Settings

_FEW: Final = 5
"""Late cycles that any run may have: one is late whenever a stack pauses, between waypoints or for
a recovery, and a short run has few others."""
_SILENCE: Final = 10.0
"""A stack that is silent for this time hangs [s of wall clock]."""
_MOST_BEHIND: Final = 4
"""Largest lag of a command's stamp [periods]; velocity smoothers pass on that of their input."""
_STEADY: Final = 3
"""Number of successive waits with earlier commands only that shows a steady lag."""

Pace = Literal["free", "locked", "quiet"]


class LockStep:
    """Pace of a run and its count of late answers.

    ``real_time``: the stack's control loop runs on the wall clock, so no cycle may be shorter than
    its period.
    """

    def __init__(self, settings: Ros2Settings, *, real_time: bool) -> None:
        self._settings, self._real_time = settings, real_time
        self.pace: Pace = "free"
        self.tolerance = settings.tolerance
        self.expected = self.late = 0
        self._silent = 0.0
        self._guessed = False
        self._lagging = 0

    def wait(self, *, active: bool) -> float:
        """Return the wait of the next cycle for a command [s]; ``active``: there is a goal."""
        if not active:
            self.pace = "free"
        real_time = max(self._settings.idle, self._settings.period)
        if self.pace == "locked":
            return self._settings.patience
        if self.pace == "quiet" or self._real_time:
            return real_time
        return self._settings.idle

    def take(
        self, answer: CycleAnswer, behind: float | None, *, active: bool
    ) -> tuple[float | None, list[SutEvent]]:
        """Judge an answer; return the latency to record [s], if any, and events.

        ``behind`` is the lag of the newest command's stamp [s], ``None`` without a stamped one.
        Raises :class:`SutFailure` if the stack cannot keep up or is silent.
        """
        if not active:
            return None, []
        if answer.latency is not None:
            return self._answered(answer.latency, behind)
        if self.pace != "locked":
            self._listen(self.wait(active=True), answer.heard)
            # Commands of earlier cycles only: wait for a stack that lags behind. Otherwise it would
            # drive the robot by old observations and never catch up.
            if answer.commands:
                self.pace = "locked"
            return None, []
        self._lagging = self._lagging + 1 if answer.commands else 0
        if self._adapts(behind):
            text = (
                f"commands are stamped {behind:.3f} s before the clock: taken as answers "
                "from now on (tolerance)"
            )
            return None, [SutEvent(text, "warn")]
        self.pace = "quiet"
        self.expected += 1
        self.late += 1
        self._listen(self._settings.patience, answer.heard)
        self.check_share()
        text = f"no command within {self._settings.patience:g} s: the last one holds"
        # Record the whole patience, so that judgements of latencies include the worst ones.
        return self._settings.patience, [SutEvent(text, "warn")]

    def check_share(self) -> None:
        """Raise :class:`SutFailure` if too large a share of the cycles was late."""
        if self.late > max(_FEW, self._settings.late * self.expected):
            share = 100.0 * self.late / self.expected
            raise SutFailure(
                f"the stack could not keep up: {self.late} of {self.expected} cycles "
                f"({share:.0f} %) were late, at most {100.0 * self._settings.late:g} % may be; "
                f"a longer patience than {self._settings.patience:g} s or a smaller load would "
                f"help, or a larger period if its controller does not run every "
                f"{self._settings.period:g} s"
            )

    def _answered(
        self, latency: float, behind: float | None
    ) -> tuple[float | None, list[SutEvent]]:
        events = []
        if behind is None and not self._guessed:
            self._guessed = True
            events.append(
                SutEvent(
                    "commands have no stamp: one that comes after the clock of a cycle is taken "
                    "as its answer",
                    "debug",
                )
            )
        self.pace = "locked"
        self.expected += 1
        self._silent, self._lagging = 0.0, 0
        return latency, events

    def _adapts(self, behind: float | None) -> bool:
        """Raise the tolerance to a steady lag of stamps; a single lag may be a busy moment."""
        if self._lagging < _STEADY:
            return False
        most = _MOST_BEHIND * self._settings.period + 1e-9
        if behind is None or not self.tolerance < behind <= most:
            return False
        self.tolerance = behind
        return True

    def _listen(self, waited: float, alive: bool) -> None:
        self._silent = 0.0 if alive else self._silent + waited
        if self._silent >= max(_SILENCE, 3.0 * self._settings.patience):
            raise SutFailure(
                f"the stack has said nothing for {self._silent:.0f} s of wall clock with a goal "
                "active: it hangs"
            )
