"""Lock step: how long a cycle waits for a stack, and what a missing answer means.

Three paces. *Free*: nothing is expected, because no goal is active or the first command has not
come; the clock goes on after a short wait (PX4 does the same until the first actuator message).
*Locked*: every cycle waits for its command, at most the patience. *Quiet*: after a cycle that was
not answered the clock goes on at the pace of real time until commands come again, because a
stack that plans anew or waits in a recovery commands nothing for seconds and is none the worse. A
stack that says nothing at all for ten seconds of it hangs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from daemon.model.sut import SutEvent, SutFailure
from daemon.stacks.ros2.settings import Ros2Settings

_FEW: Final = 5
"""So many cycles may be late in any run: one is lost whenever a stack pauses, between waypoints or
for a recovery, and a short run has few others."""
_SILENCE: Final = 10.0
"""A stack that says nothing for so long [s of wall clock] does not work any more."""
_MOST_BEHIND: Final = 4
"""Commands may be stamped up to so many periods before the clock: a velocity smoother passes on the
stamp of what it was given."""
_STEADY: Final = 3
"""So many waits in a row that ended with nothing but earlier commands show that it is a habit."""

Pace = Literal["free", "locked", "quiet"]


@dataclass(frozen=True, slots=True)
class HeardAnswer:
    """Answer to a cycle: its ``latency`` [s], ``None`` without one.

    ``behind`` is how far the newest command's stamp lies before the clock [s], ``None`` without a
    stamped command; ``commands`` counts all; ``alive``: any message came.
    """

    latency: float | None
    behind: float | None
    commands: int
    alive: bool


class LockStep:
    """The pace of one run and its count of late answers.

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
        """Return how long the next cycle waits for a command [s]; ``active``: there is a goal."""
        if not active:
            self.pace = "free"
        real_time = max(self._settings.idle, self._settings.period)
        if self.pace == "locked":
            return self._settings.patience
        if self.pace == "quiet" or self._real_time:
            return real_time
        return self._settings.idle

    def take(self, answer: HeardAnswer, *, active: bool) -> tuple[float | None, list[SutEvent]]:
        """Judge an answer; return the latency to record [s], if any, and events.

        Raises :class:`SutFailure` when the stack cannot keep up or has gone silent.
        """
        if not active:
            return None, []
        if answer.latency is not None:
            return self._answered(answer)
        if self.pace != "locked":
            self._listen(self.wait(active=True), answer.alive)
            # Commands, but of earlier cycles: a stack that lags behind is waited for, or it would
            # drive the robot by what it saw long ago and never catch up.
            if answer.commands:
                self.pace = "locked"
            return None, []
        self._lagging = self._lagging + 1 if answer.commands else 0
        if self._adapts(answer):
            text = (
                f"commands are stamped {answer.behind:.3f} s before the clock: taken as answers "
                "from now on (tolerance)"
            )
            return None, [SutEvent(text, "warn")]
        self.pace = "quiet"
        self.expected += 1
        self.late += 1
        self._listen(self._settings.patience, answer.alive)
        self.check_share()
        text = f"no command within {self._settings.patience:g} s: the last one holds"
        # Recorded as the whole patience: what judges latencies must not miss the worst ones.
        return self._settings.patience, [SutEvent(text, "warn")]

    def check_share(self) -> None:
        """Raise :class:`SutFailure` when too large a share of the cycles was late."""
        if self.late > max(_FEW, self._settings.late * self.expected):
            share = 100.0 * self.late / self.expected
            raise SutFailure(
                f"the stack could not keep up: {self.late} of {self.expected} cycles "
                f"({share:.0f} %) were late, at most {100.0 * self._settings.late:g} % may be; "
                f"a longer patience than {self._settings.patience:g} s or a smaller load would "
                f"help, or a larger period if its controller does not run every "
                f"{self._settings.period:g} s"
            )

    def _answered(self, answer: HeardAnswer) -> tuple[float | None, list[SutEvent]]:
        events = []
        if answer.behind is None and not self._guessed:
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
        return answer.latency, events

    def _adapts(self, answer: HeardAnswer) -> bool:
        """Take a steady lag of stamps for what it is, no moment of a busy machine."""
        behind = answer.behind
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
