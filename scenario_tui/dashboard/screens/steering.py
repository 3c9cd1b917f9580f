"""Steering a campaign: pause, priority, cancel, retry; judging it again and its report."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Final

from textual.app import SystemCommand
from textual.binding import Binding, BindingType

from grammars.text.words import count_noun
from scenario_tui.campaign_actions import (
    ACKNOWLEDGE,
    CANCEL,
    DELETE,
    KEYED,
    PAUSE,
    PRIORITY,
    RESUME,
    RETRY,
    CampaignAction,
    deletion_text,
)
from scenario_tui.dashboard.screens.base import BaseScreen
from scenario_tui.dashboard.screens.dialogs import (
    Menu,
    MenuChoice,
    Prompt,
    Question,
    numbered_choices,
)
from scenario_tui.dashboard.screens.trace_actions import judge_again, make_report

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow
    from daemon.model.verbs import DaemonClient

_ABOUT_CAMPAIGN: Final = frozenset(
    {"matrix", "judge", "report", "commands", *(action.command for action in KEYED)}
)
"""Ids of the keys that do something about a campaign."""
_LOST: Final = "lost|cancelled"
"""What `scenario retry` queues again without --only."""
_KINDS: Final = (
    ("l", "lost and cancelled", _LOST),
    ("f", "failed", "fail"),
    ("e", "broken (error)", "error"),
    ("i", "inconclusive", "inconclusive"),
    ("a", "all that are over", "all"),
)


class SteeringScreen(BaseScreen):
    """A screen about a campaign that can be steered from it."""

    BINDINGS: ClassVar[list[BindingType]] = [
        *(
            Binding(
                action.key, action.command, action.name, show=False, id=action.command,
                tooltip=action.tooltip,
            )
            for action in KEYED
        ),
        Binding(
            "E", "judge", "Judge again", show=False, id="judge",
            tooltip="By other oracles, say",
        ),
        Binding(
            "o", "report", "Report", show=False, id="report",
            tooltip="Write it as a page with figures",
        ),
        Binding(
            "Y", "commands", "Commands", show=False, id="commands",
            tooltip="All commands about it and its campaign, to copy",
        ),
    ]  # fmt: skip

    def campaign(self) -> CampaignRow | None:
        """Return the campaign the keys are about."""
        raise NotImplementedError

    def rejudge_target(self) -> str:
        """Return the run that is judged again, empty for all of the campaign."""
        return ""

    def command(self) -> str:
        """Return what to type for the results of the campaign."""
        row = self.campaign()
        if row is None:
            return super().command()
        return self._line("search" if row.search else "results", row.id)

    def cursor_lines(self) -> list[tuple[str, str]]:
        """Return what can be typed about what the cursor is on: in words, and the commands."""
        return []

    def run_lines(self, run: str) -> list[tuple[str, str]]:
        """Return what can be typed about a run."""
        return [
            ("show the run", self._line("show", run)),
            ("watch it", self._line("replay", run)),
            ("draw its signals", self._line("plot", run)),
            ("execute it again", self._line("verify", run)),
        ]

    def pointless_keys(self) -> frozenset[str]:
        """Return the ids of keys with nothing to do now: they are not about such a campaign."""
        row, barred = self.campaign(), super().pointless_keys()
        if row is None:
            # Before anything is known, nothing is known to be missing.
            return barred | _ABOUT_CAMPAIGN if self.dashboard.daemon_state.at else barred
        if row.search:
            barred |= {"matrix"}
        if row.finished:
            barred |= {"pause", "cancel", "priority"}
        else:
            barred |= {"delete"}
        return barred if _over(row, "all") else barred | {"retry", "report", "judge"}

    def update_from_state(self) -> None:
        """Bring everything up to date; the key that pauses is also the one that resumes."""
        super().update_from_state()
        if not self._composed or not self.app.is_running:
            return
        renamed = self.renamed_keys()
        pointless = self.pointless_keys()
        if (self._renamed, self._pointless) != (renamed, pointless):
            self._renamed, self._pointless = renamed, pointless
            self.refresh_bindings()

    def renamed_keys(self) -> dict[str, str]:
        """Return what keys are called just now, by their id."""
        row = self.campaign()
        return {"pause": "Resume"} if row is not None and row.paused else {}

    _pointless: frozenset[str] = frozenset()
    """The ids of keys that are not offered, as they are shown."""

    def palette_commands(self) -> Iterable[SystemCommand]:
        """Yield retrying of each kind: the key only opens a menu of them."""
        for _, words, only in _KINDS:
            retry = partial(self._retry_only, only)
            yield SystemCommand(f"Retry {words}", "Queue these runs again", retry)

    def _line(self, command: str, *arguments: str) -> str:
        return self.dashboard.command_lines.daemon_line(command, *arguments)

    def _about(self, *, steering: bool = True) -> CampaignRow | None:
        """Return the campaign to do something about; say so when there is none, or it is barred."""
        if steering and not self.dashboard.may_steer():
            return None
        row = self.campaign()
        if row is None:
            self.notify("there is no campaign here to do that with")
        return row

    def _steer(
        self,
        action: CampaignAction,
        row: CampaignRow,
        *options: str,
        ending: str = "",
        **given: object,
    ) -> None:
        """Have the daemon do something to a campaign; say what came of it."""

        def act(daemon: DaemonClient) -> str:
            runs = action.request(daemon, row.id, **given)
            return action.outcome_text(row.id, runs, self._line, **given)

        line = self._line(action.command, row.id, *action.options, *options)
        self.dashboard.steer(lambda daemon: act(daemon) + ending, line)

    def action_matrix(self) -> None:
        """Show the campaign's matrix."""
        row = self._about(steering=False)
        if row is not None and row.search:
            self.notify(f"{row.id} is a search: nothing was expected of its runs")
        elif row is not None:
            self.dashboard.open_matrix(row.id)

    def action_pause(self) -> None:
        """Pause, or go on with, the campaign."""
        row = self._about()
        if row is None:
            return
        if row.paused:
            self._steer(RESUME, row)
        elif row.finished:
            self.notify(f"{row.id} is finished, there is nothing to pause")
        else:
            self._steer(PAUSE, row)

    def action_acknowledge(self) -> None:
        """Note that what went wrong in the campaign is known."""
        if row := self._about():
            self._steer(ACKNOWLEDGE, row)

    def action_priority(self) -> None:
        """Ask for another priority."""
        row = self._about()
        if row is None:
            return
        if row.finished:
            self.notify(f"{row.id} is finished, its priority says nothing any more")
            return

        def decided(answer: str | None) -> None:
            if answer is not None:
                self._steer(PRIORITY, row, answer, priority=int(answer))

        from daemon.model.messages import HIGHEST_PRIORITY

        span = f"−{HIGHEST_PRIORITY} to {HIGHEST_PRIORITY}"
        text = f"Priority of {row.id}\n{span}, usual is 0; the highest goes first"
        prompt = Prompt(
            text,
            str(row.priority),
            _no_priority,
            lambda answer: self._line("priority", row.id, str(int(answer))),
        )
        self.app.push_screen(prompt, decided)

    def action_cancel(self) -> None:
        """Ask whether to cancel, then do it."""
        row = self._about()
        if row is None:
            return
        waiting = row.queued + row.running
        if not waiting:
            self.notify(f"{row.id} is finished, there is nothing to cancel")
            return

        def decided(yes: bool | None) -> None:
            if yes:
                self._steer(CANCEL, row)

        text = f"Cancel {count_noun(waiting, 'unfinished run')} of {row.id}? Its results are kept."
        self.app.push_screen(Question(text, self._line("cancel", row.id)), decided)

    def action_delete(self) -> None:
        """Ask whether to remove the campaign, then do it."""
        row = self._about()
        if row is None:
            return
        if not row.finished:
            self.notify(f"{row.id} is not finished: cancel it before it is deleted")
            return

        def decided(yes: bool | None) -> None:
            if yes:
                self.dashboard.steer(
                    lambda daemon: deletion_text(DELETE.request(daemon, row.id)),
                    self._line("delete", row.id),
                )

        text = (
            f"Delete {row.id} with its {count_noun(row.total, 'run')}, results and traces?\n"
            "Nothing brings them back."
        )
        self.app.push_screen(Question(text, self._line("delete", row.id)), decided)

    def action_retry(self) -> None:
        """Ask which runs to queue again."""
        row = self._about()
        if row is None:
            return
        choices = [self._choice(row, key, words, only) for key, words, only in _KINDS]
        if all(choice.why_not for choice in choices):
            self.notify(f"no run of {row.id} is over: there is nothing to retry yet")
            return

        def decided(index: int | None) -> None:
            if index is not None:
                self._retry(row, _KINDS[index][2])

        note = "Runs that have a result keep it: running them again checks it."
        self.app.push_screen(Menu(f"Retry which runs of {row.id}?", choices, note), decided)

    def _retry_only(self, only: str) -> None:
        """Queue runs of one kind again."""
        row = self._about()
        if row is None:
            return
        if not _over(row, only):
            self.notify(f"{row.id} has no such run")
            return
        self._retry(row, only)

    def _retry(self, row: CampaignRow, only: str) -> None:
        waits = "; it is paused, they wait until it is resumed" if row.paused else ""
        self._steer(RETRY, row, *_only(only), ending=waits, only=only)

    def _choice(self, row: CampaignRow, key: str, words: str, only: str) -> MenuChoice:
        runs = _over(row, only)
        why_not = "" if runs else "none"
        text = f"{words}: {runs:,}" if runs else words
        return MenuChoice(key, text, self._line("retry", row.id, *_only(only)), why_not)

    def action_judge(self) -> None:
        """Ask by which oracles, then judge the recorded runs again."""
        row = self._about(steering=False)
        if row is not None:
            judge_again(self.dashboard, row, self.rejudge_target() or row.id)

    def action_report(self) -> None:
        """Write the report."""
        row = self._about(steering=False)
        if row is not None:
            make_report(self.dashboard, row)

    def action_commands(self) -> None:
        """Show what to type about the campaign, to copy a line of it."""
        row = self._about(steering=False)
        if row is None:
            return
        lines = self._lines(row)

        def decided(index: int | None) -> None:
            if index is not None:
                self.dashboard.copy(lines[index][1])

        menu = Menu("Copy which command?", numbered_choices(lines, 1))
        self.app.push_screen(menu, decided)

    def _lines(self, row: CampaignRow) -> list[tuple[str, str]]:
        other = "resume" if row.paused else "pause"
        about = [
            *self.cursor_lines(),
            ("what this screen shows", self.command()),
            ("results of the campaign", self._line("results", row.id)),
            ("write its report", self._line("report", row.id)),
            (f"{other} it", self._line("pause", row.id, *(["--off"] if row.paused else []))),
            ("cancel it", self._line("cancel", row.id)),
            ("retry what failed", self._line("retry", row.id, "--only", "fail")),
            ("retry what was lost or cancelled", self._line("retry", row.id)),
            ("give it priority 1", self._line("priority", row.id, "1")),
            ("delete it", self._line("delete", row.id)),
        ]
        return [(words, line) for line, words in {line: words for words, line in about}.items()]


def schedule_marks(row: CampaignRow) -> list[str]:
    """Return what is unusual about when the runs of a campaign start."""
    paused = "‖ paused" if row.paused and not row.finished else ""
    unusual = priority_text(row.priority) if row.priority else ""
    return [mark for mark in (paused, unusual) if mark]


def priority_text(priority: int) -> str:
    """Return ``priority −5``."""
    return f"priority {priority}".replace("-", "−")


def _over(row: CampaignRow, only: str) -> int:
    """Return how many runs of a kind there are to be queued again."""
    return {
        _LOST: row.lost + row.cancelled,
        "fail": row.failed,
        "error": row.errors,
        "inconclusive": row.inconclusive,
        "all": row.done + row.lost + row.cancelled,
    }[only]


def _only(kind: str) -> tuple[str, ...]:
    """Return the option that retries runs of a kind: lost and cancelled ones need none."""
    return () if kind == _LOST else ("--only", kind)


def _no_priority(answer: str) -> str:
    """Return why an answer is no priority, empty when it is one."""
    from daemon.model.messages import HIGHEST_PRIORITY

    try:
        number = int(answer)
    except ValueError:
        return "write a whole number, such as 5 or -5"
    return (
        ""
        if -HIGHEST_PRIORITY <= number <= HIGHEST_PRIORITY
        else f"at least −{HIGHEST_PRIORITY}, at most {HIGHEST_PRIORITY}"
    )
