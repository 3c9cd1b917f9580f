"""Submission of a campaign: the files of this folder, and the findings of the chosen one."""

from __future__ import annotations

import asyncio
import os
from dataclasses import replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import ClassVar, Final

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, VerticalScroll
from textual.widgets import Input, OptionList
from textual.widgets.option_list import Option

from daemon.batch.errors import DaemonError
from daemon.model.status import SubmissionReceipt, WorkerRow
from daemon.model.verbs import DaemonClient
from grammars.text.diagnostics import Finding, InputError, Severity, Where
from grammars.text.words import count_noun
from scenario_tui.campaign_files import find_campaigns, fuzzy_matches, relative_name
from scenario_tui.dashboard.screens.base import BaseScreen
from scenario_tui.dashboard.screens.dialogs import move_cursor, same_as
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.library.submission import CheckedFile, plan_text, receipt_text, searches_text
from scenario_tui.text.diagnostics import diagnostic_counts, render_diagnostic
from scenario_tui.text.styles import GLYPHS, QUIET

_PAUSE: Final = 0.15
"""Seconds for which the cursor rests on a file before its check."""
_DEMO: Final = "the demo that comes with scenario"


class SubmitScreen(BaseScreen["tuple[WorkerRow, ...]"]):
    """Chooses a campaign file by parts of its name, and checks it meanwhile."""

    AUTO_FOCUS = "#wanted"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "submit_file", "Submit", id="submit-file", priority=True,
                tooltip="Submit the campaign to the daemon"),
        Binding("down", "move(1)", "Next", id="next-file", key_display="↓", priority=True,
                tooltip="The next file"),
        Binding("up", "move(-1)", "Before", id="previous-file", key_display="↑", priority=True,
                tooltip="The file before"),
        Binding("ctrl+r", "fresh", "Run all anew", id="fresh", priority=True,
                tooltip="Run all runs, or only those without a result"),
    ]  # fmt: skip

    def __init__(self) -> None:
        super().__init__()
        self._here = Path.cwd()
        self._files: dict[str, Path] = {}
        self._checked: dict[Path, CheckedFile] = {}
        self._fresh, self._refused = False, ""
        self._line = Input(placeholder="parts of the name", id="wanted", compact=True)
        self._list = OptionList(id="files", compact=True)
        self._about = StaticText(id="about")

    def body(self) -> ComposeResult:
        """Lay out the line to type into, the matching files, the findings."""
        yield self._line
        with Container(id="picker"):
            yield self._list
            findings = VerticalScroll(id="findings")
            findings.border_title = "check "
            with findings:
                yield self._about

    def on_mount(self) -> None:
        """Look for files."""
        self._list.can_focus = False
        self.dashboard.start_task(
            partial(find_campaigns, self._here), self._list_files, self.dashboard.problem
        )

    def trail(self) -> str:
        """Return the folder, the number of files, and a note if all runs run anew."""
        parts = ["submit a campaign", f"{self._here}"]
        if self._files:
            parts.append(f"{self._list.option_count} of {count_noun(len(self._files), 'file')}")
        return "  ".join([*parts, *(["everything anew"] if self._fresh else [])])

    def command(self) -> str:
        """Return the command that submits the chosen file."""
        path = self._chosen()
        name = "CAMPAIGN.yaml" if path is None else relative_name(path, self._here)
        fresh = ("--fresh",) if self._fresh else ()
        return self.dashboard.target.command("submit", name, *fresh)

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> tuple[WorkerRow, ...]:
        """Return the workers, for the number of parallel runs."""
        return daemon.workers()

    def show(self, state: DashboardState, news: tuple[WorkerRow, ...] | None) -> None:
        """Show the findings."""
        self._say()

    def _list_files(self, near: tuple[Path, ...]) -> None:
        """List the last submitted files, then the last changed ones, then the demo."""
        demo = Path(str(files("campaigns"))) / "demo" / "campaign.yaml"
        used = [path for path in self.dashboard.submitted if path in near]
        own = [path for path in dict.fromkeys((*used, *near)) if path != demo]
        # The demo comes last, because the user's own files may have "demo" in their names.
        self._files = {relative_name(path, self._here): path for path in own} | {_DEMO: demo}
        self._narrow()

    @on(Input.Changed)
    def _narrow(self) -> None:
        """List the files that match the typed text."""
        names = fuzzy_matches(tuple(self._files), self._line.value)
        self._list.set_options(
            Option(Text(name, no_wrap=True, overflow="ellipsis"), name) for name in names
        )
        self._list.highlighted = 0 if names else None
        self.update_from_state()

    def _chosen(self) -> Path | None:
        option = self._list.highlighted_option
        return None if option is None else self._files[str(option.id)]

    def on_option_list_option_highlighted(self) -> None:
        """Check the file under the cursor, once it rests there."""
        self._refused = ""
        self._say()
        if (path := self._chosen()) is not None:
            self._check(path)

    @work(exclusive=True)
    async def _check(self, path: Path) -> None:
        """Check a file once the cursor rests on it, again each time: it may have changed."""
        await asyncio.sleep(_PAUSE)
        overview = self.dashboard.state.overview
        state = Path(overview.state) if overview is not None else None
        try:
            checked = await asyncio.to_thread(self.dashboard.check_file, path, state=state)
        except DaemonError as error:
            checked = CheckedFile("", (Finding(Where(str(path)), str(error)),))
        self._checked[path] = checked
        self._say()

    def _say(self) -> None:
        """Show the findings of the file under the cursor."""
        path = self._chosen()
        if path is None:
            self._about.update("No campaign file matches." if self._files else "")
            return
        if self.dashboard.submitting or path not in self._checked:
            text = Text("… submitting" if self.dashboard.submitting else "… checking", style=QUIET)
        else:
            checked = self._checked[path]
            text = _checked_text(checked, self._here)
            if checked.plan is not None:
                slots = sum(row.slots for row in self.news or () if not row.away)
                text.append(f"\n\n{plan_text(checked.plan, slots, fresh=self._fresh)}")
            if checked.searches:
                name = Path(relative_name(path, self._here))
                text.append(f"\n\n{searches_text(name, checked.searches)}", style=QUIET)
        if self._refused:
            text.append(f"\n\n{self._refused}", "fail")
        text.append("\n\n")
        text.append_text(same_as(self.command()))
        self._about.update(text)

    def action_submit_file(self) -> None:
        """Submit the file, unless it has errors."""
        path = self._chosen()
        if path is not None and not self.dashboard.submitting:
            self._refused, self.dashboard.submitting = "", relative_name(path, self._here)
            self._say()
            self.dashboard.start_task(
                partial(self._submit, path, self._fresh),
                partial(self._leave_with, path, self.command()),
                self._refuse,
            )

    def _submit(self, path: Path, fresh: bool) -> SubmissionReceipt:
        """Read a file anew, because it may have changed, and submit it; in a separate thread.

        A daemon under load may take longer than the feed waits for its answers.
        """
        checked = self.dashboard.check_file(path, submit=True, fresh=fresh)
        if checked.submission is None:
            self._checked[path] = checked
            raise InputError(one for one in checked.findings if one.severity is Severity.ERROR)
        with self.dashboard.feed.connect() as daemon:
            return daemon.submit(checked.submission)

    def _leave_with(self, path: Path, command: str, receipt: SubmissionReceipt) -> None:
        """Go back to the campaigns: the daemon has this one."""
        self.dashboard.submitting = ""
        self.dashboard.remember(path, receipt.campaign)
        self.dashboard.say(receipt_text(receipt), command)
        if self.is_current:
            self.app.pop_screen()

    def _refuse(self, why: str) -> None:
        self.dashboard.submitting = ""
        self._refused = f"not submitted: {why.splitlines()[0]}"
        self.dashboard.problem(self._refused)
        self._say()

    def action_move(self, step: int) -> None:
        """Go to another file."""
        move_cursor(self._list, step)

    def action_fresh(self) -> None:
        """Run all runs, or only those without a result."""
        self._fresh = not self._fresh
        self.update_from_state()

    def action_back(self) -> None:
        """Clear the typed text first, then leave."""
        if self._line.value:
            self._line.value = ""
        else:
            super().action_back()


def _checked_text(checked: CheckedFile, here: Path) -> Text:
    """Return a file and its findings in words; paths are relative to ``here``."""
    has_errors = any(one.severity is Severity.ERROR for one in checked.findings)
    about = f"{checked.about}, " if checked.about else ""
    word = "fail" if has_errors else "pass"
    words = f"{GLYPHS[word]} {about}{diagnostic_counts(checked.findings)}"
    text = Text.assemble((words, word))
    for finding in checked.findings:
        where = finding.where
        # Relative paths are shorter, and screens are narrow.
        file = relative_name(Path(os.path.normpath(where.file)), here) if where.file else ""
        nearer = replace(finding, where=replace(where, file=file))
        text.append("\n\n").append_text(render_diagnostic(nearer))
    return text
