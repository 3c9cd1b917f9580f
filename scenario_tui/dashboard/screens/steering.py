"""Steering a campaign by keys, and its report.

The key of an impossible action is grey, and shows the reason when pressed (:class:`Refusal`).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

from textual.binding import Binding, BindingType
from textual.screen import ModalScreen
from textual.validation import Integer

from daemon.batch.errors import DaemonError
from daemon.batch.paths import StatePaths
from daemon.model.execution import python_command
from grammars.text.words import command_line, count_noun
from scenario_tui.campaign_actions import (
    ACKNOWLEDGE,
    CANCEL,
    DELETE,
    PAUSE,
    PRIORITY,
    RESUME,
    RETRY,
    CampaignAction,
    deletion_text,
)
from scenario_tui.dashboard.screens.base import BaseScreen, T
from scenario_tui.dashboard.screens.dialogs import Menu, MenuChoice, Prompt, Question, Refusal

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow
    from daemon.model.verbs import DaemonClient

CommandLine = Callable[..., str]
"""Quotes a command about the daemon of this dashboard."""

_LOST: Final = "lost|cancelled"
"""Default runs of `scenario retry`."""
_KINDS: Final[tuple[tuple[str, str, str, Callable[[CampaignRow], int]], ...]] = (
    ("l", "lost and cancelled", _LOST, lambda row: row.lost + row.cancelled),
    ("f", "failed", "fail", lambda row: row.failed),
    ("e", "broken (error)", "error", lambda row: row.errors),
    ("i", "inconclusive", "inconclusive", lambda row: row.inconclusive),
    ("a", "all ended ones", "all", lambda row: row.done + row.lost + row.cancelled),
)
"""Key, words, argument of --only and number of each kind of runs to queue again."""
_ERROR: Final = "scenario/error/1"
_SSH: Final = ("SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY")
_DISPLAYS: Final = ("DISPLAY", "WAYLAND_DISPLAY")


@dataclass(frozen=True, slots=True)
class _Steering:
    """An action with a key: the reason why it is impossible, if any, and the dialog before it.

    ``arguments`` turns the answer into options of the command and keywords of the request.
    """

    action: CampaignAction
    why_not: Callable[[CampaignRow], str]
    dialog: Callable[[CampaignRow, CommandLine], ModalScreen[str]] | None = None
    arguments: Callable[[str], tuple[tuple[str, ...], dict[str, Any]]] = lambda _: ((), {})


def _question(
    action: CampaignAction, text: Callable[[CampaignRow], str]
) -> Callable[[CampaignRow, CommandLine], Question]:
    return lambda row, line: Question(text(row), line(action.command, row.id))


def _ask_priority(row: CampaignRow, line: CommandLine) -> Prompt:
    from daemon.model.messages import HIGHEST_PRIORITY

    span = f"−{HIGHEST_PRIORITY} to {HIGHEST_PRIORITY}"
    return Prompt(
        f"Priority of {row.id}\n{span}, default 0; the highest runs first",
        str(row.priority),
        Integer(-HIGHEST_PRIORITY, HIGHEST_PRIORITY, f"write a whole number, {span}"),
        lambda answer: line(PRIORITY.command, row.id, str(int(answer))),
    )


def _ask_kind(row: CampaignRow, line: CommandLine) -> Menu:
    choices = []
    for key, words, only, count in _KINDS:
        runs = count(row)
        text = f"{words}: {runs:,}" if runs else f"{words}  (none)"
        command = line(RETRY.command, row.id, *_only(only))
        choices.append(MenuChoice(only, key, text, command, runs > 0))
    waits = "It is paused, so they wait until it is resumed. " if row.paused else ""
    note = f"{waits}Runs keep their result: another execution checks it."
    return Menu(f"Retry which runs of {row.id}?", choices, note)


def _only(kind: str) -> tuple[str, ...]:
    """Return the option that retries runs of a kind; lost and cancelled ones need none."""
    return () if kind == _LOST else ("--only", kind)


_STEERING: Final[Mapping[str, _Steering]] = {
    "pause": _Steering(
        PAUSE,
        lambda row: f"{row.id} is finished, so it cannot be paused." if row.finished else "",
    ),
    "resume": _Steering(RESUME, lambda row: ""),
    "cancel": _Steering(
        CANCEL,
        lambda row: (
            "" if row.queued + row.running else f"{row.id} is finished, so it cannot be cancelled."
        ),
        _question(
            CANCEL,
            lambda row: (
                f"Cancel {count_noun(row.queued + row.running, 'unfinished run')} of {row.id}? "
                "Its results are kept."
            ),
        ),
    ),
    "retry": _Steering(
        RETRY,
        lambda row: "" if _KINDS[-1][-1](row) else f"No run of {row.id} has ended yet.",
        _ask_kind,
        lambda answer: (_only(answer), {"only": answer}),
    ),
    "acknowledge": _Steering(
        ACKNOWLEDGE,
        lambda row: f"{row.id} is acknowledged already." if row.acknowledged else "",
    ),
    "priority": _Steering(
        PRIORITY,
        lambda row: f"{row.id} is finished, so its priority has no effect." if row.finished else "",
        _ask_priority,
        lambda answer: ((answer,), {"priority": int(answer)}),
    ),
    "delete": _Steering(
        DELETE,
        lambda row: "" if row.finished else f"{row.id} is not finished: cancel it, then delete it.",
        _question(
            DELETE,
            lambda row: (
                f"Delete {row.id} with its {count_noun(row.total, 'run')}, results and traces?\n"
                "This cannot be undone."
            ),
        ),
    ),
}


def steering_keys(*in_line: str) -> list[BindingType]:
    """Return the keys of all actions; the line of keys shows those with the names ``in_line``."""
    return [
        Binding(
            one.action.key, f"steer('{name}')", one.action.name, show=name in in_line,
            id=one.action.command, tooltip=one.action.tooltip,
        )
        for name, one in _STEERING.items()
    ]  # fmt: skip


class SteeringScreen(BaseScreen[T]):
    """A screen about a campaign that can be steered from it."""

    BINDINGS: ClassVar[list[BindingType]] = [
        *steering_keys(),
        Binding(
            "o", "report", "Report", show=False, id="report",
            tooltip="Write a page with figures about it",
        ),
    ]  # fmt: skip

    def campaign(self) -> CampaignRow | None:
        """Return the campaign of the keys."""
        return self.dashboard.state.campaign(self.about)

    def command(self) -> str:
        """Return the command for the results of the campaign."""
        row = self.campaign()
        if row is None:
            return super().command()
        return self._line("search" if row.search else "results", row.id)

    def _line(self, command: str, *arguments: str) -> str:
        return self.dashboard.target.command(command, *arguments)

    def why_not(self, action: str, *parameters: object) -> str:
        """Return why an action is impossible now, empty if it is possible."""
        why = super().why_not(action, *parameters)
        # Before the first answer, the campaign may still come.
        if why or action not in ("steer", "report", "matrix") or not self.dashboard.state.at:
            return why
        row = self.campaign()
        if row is None:
            return "There is no campaign under the cursor."
        if action == "steer":
            return _STEERING[str(parameters[0])].why_not(row)
        if action == "report":
            return self._why_no_report(row)
        return f"{row.id} is a search, which has no expectations." if row.search else ""

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Hide pausing or resuming, which share a key."""
        if action == "steer" and parameters[0] in ("pause", "resume"):
            row = self.campaign() if self._composed else None
            if (row is not None and row.paused) != (parameters[0] == "resume"):
                return False
        return super().check_action(action, parameters)

    def _row(self) -> CampaignRow | None:
        """Return the campaign, or refuse the action before the first answer."""
        row = self.campaign()
        if row is None:
            self.app.push_screen(Refusal("The daemon has not answered yet."))
        return row

    def action_matrix(self) -> None:
        """Show the campaign's matrix."""
        if (row := self._row()) is not None:
            self.dashboard.open("matrix", row.id)

    def action_runs(self) -> None:
        """Open all runs of the campaign."""
        self.dashboard.open("runs", self.about)

    def action_steer(self, name: str) -> None:
        """Start an action on the campaign, after a dialog if it has one."""
        steering, row = _STEERING[name], self._row()
        if row is None:
            return
        if steering.dialog is None:
            self._steer(steering, row, "")
            return

        def decide(answer: str | None) -> None:
            if answer is not None:
                self._steer(steering, row, answer)

        self.app.push_screen(steering.dialog(row, self._line), decide)

    def _steer(self, steering: _Steering, row: CampaignRow, answer: str) -> None:
        """Request the action; its outcome is shown with the equivalent command."""
        action = steering.action
        options, keywords = steering.arguments(answer)

        def act(daemon: DaemonClient) -> str:
            outcome = action.request(daemon, row.id, **keywords)
            if action is DELETE:
                return deletion_text(outcome)
            return action.outcome_text(row.id, outcome, self._line, **keywords)

        line = self._line(action.command, row.id, *action.options, *options)
        self.dashboard.steer(act, line)

    def _why_no_report(self, row: CampaignRow) -> str:
        overview = self.dashboard.state.overview
        assert overview is not None
        if not StatePaths(Path(overview.state)).ledger.is_file():
            where = f"{overview.state} on the daemon's machine"
            return f"The traces of {row.id} are not on this machine ({where})."
        return "" if row.done else f"No run of {row.id} has a result yet."

    def action_report(self) -> None:
        """Write the report, and open it in a browser of this machine's screen."""
        dashboard, row = self.dashboard, self._row()
        overview = dashboard.state.overview
        if row is None or overview is None:
            return
        page, state = Path.cwd() / f"{row.id}.html", Path(overview.state)
        arguments = ["report", row.id, "-o", page.name]
        # Without the directory if the command finds it, to keep the line short.
        if dashboard.target.state or state != StatePaths.find().state:
            arguments += ["--state", str(dashboard.target.state or state)]
        command, doing = command_line(*arguments), f"writing the report of {row.id}"
        if doing in dashboard.running_jobs:
            dashboard.notify(f"… {doing} already", markup=False)
            return
        dashboard.running_jobs.add(doing)
        dashboard.say(f"{doing} …", command)

        def done(answer: Mapping[str, Any]) -> None:
            dashboard.running_jobs.discard(doing)
            opened = open_in_browser(page)
            where = "opened in the browser" if opened else "open it in a browser"
            dashboard.say(f"{answer['answer']}\n{page} ({where})", command)

        def failed(why: str) -> None:
            dashboard.running_jobs.discard(doing)
            dashboard.problem(why)

        dashboard.start_task(partial(dashboard.run_command, tuple(arguments)), done, failed)


def run_command(arguments: tuple[str, ...]) -> Mapping[str, Any]:
    """Run a command of ``scenario`` in a process; return the object it wrote.

    The command continues if the user leaves the dashboard. Raises
    :class:`daemon.batch.errors.DaemonError` with its last words if it wrote no object.
    """
    done = subprocess.run(
        python_command("-c", "from scenario_tui.cli import main; main()", *arguments, "--json"),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
        # Its last words become a notice: in one line, without colours.
        env=os.environ | {"COLUMNS": "160", "TERM": "dumb"},
    )
    try:
        answer: Mapping[str, Any] = json.loads(done.stdout)
    except ValueError as error:
        words = [line for line in done.stderr.splitlines() if line.strip()]
        last = words[-1] if words else f"it left with code {done.returncode}"
        message = f"{command_line(*arguments)}: {last.removeprefix('scenario: ')}"
        raise DaemonError(message) from error
    if answer.get("schema") == _ERROR:
        raise DaemonError(f"{command_line(*arguments)}: {answer['error']}")
    return answer


def has_display(environ: Mapping[str, str]) -> bool:
    """Return True if the user sits at this machine's own screen; never over SSH."""
    # Even with a forwarded display, because a browser over the line would be slow.
    return any(map(environ.get, _DISPLAYS)) and not any(map(environ.get, _SSH))


def open_in_browser(page: Path) -> bool:
    """Open a page in the browser of this machine's screen; return True if there is one."""
    opener = shutil.which("xdg-open")
    if opener is None or not has_display(os.environ):
        return False
    # The browser outlives the dashboard and must not write over it.
    subprocess.Popen(
        [opener, page.as_uri()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    return True


def schedule_marks(row: CampaignRow | None) -> list[str]:
    """Return unusual facts about the start of a campaign's runs."""
    if row is None:
        return []
    paused = "‖ paused" if row.paused and not row.finished else ""
    unusual = f"priority {row.priority}".replace("-", "−") if row.priority else ""
    return [mark for mark in (paused, unusual) if mark]
