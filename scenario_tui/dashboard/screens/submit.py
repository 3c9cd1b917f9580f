"""Submitting a campaign: files near here, what the check says of the one chosen, Enter."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, VerticalScroll
from textual.timer import Timer
from textual.widgets import Input, OptionList

from daemon.batch.paths import StatePaths
from daemon.model.submission import Submission
from daemon.model.verbs import DaemonClient
from grammars.text.diagnostics import Severity
from grammars.text.words import count_noun
from scenario_tui.campaign_files import find_files, fuzzy_matches, is_campaign, relative_name
from scenario_tui.dashboard.background import CheckQueue
from scenario_tui.dashboard.screens.base import BaseScreen, show_message_or
from scenario_tui.dashboard.screens.dialogs import move_cursor, same_as
from scenario_tui.dashboard.state import DashboardState, Query
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.library.submission import CheckedFile, plan_text, receipt_text, searches_text
from scenario_tui.text.diagnostics import diagnostic_counts, render_diagnostic
from scenario_tui.text.formatting import DASHBOARD_STYLES, GLYPHS, QUIET

_PAUSE: Final = 0.15
"""Seconds the cursor rests on a file before it is checked."""
_AGAIN: Final = 1.0
"""Seconds between two looks for whether it was edited."""
_NONE: Final = (
    "No campaign file here: a YAML file with `campaign:` in it.\n\n"
    "Leave with q and start `scenario tui` in the folder of your campaigns."
)


class SubmitScreen(BaseScreen):
    """Choose a campaign file by typing parts of its name; it is checked while you look."""

    # More than twenty methods: five answer what is asked of every screen, nine are keys and
    # messages, which Textual calls by name. What is known of files is in CheckQueue.

    AUTO_FOCUS = "#wanted"
    IN_FOOTER = ("submit-file", "next-file", "previous-file", "fresh", "back", "help")
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "submit_file", "Submit", id="submit-file", priority=True,
                tooltip="Hand the campaign to the daemon"),
        Binding("down", "move(1)", "Next", id="next-file", key_display="↓", priority=True,
                tooltip="The next file"),
        Binding("up", "move(-1)", "Before", id="previous-file", key_display="↑", priority=True,
                tooltip="The file before"),
        Binding("ctrl+r", "fresh", "Run all anew", id="fresh", priority=True,
                tooltip="Also what has a result already, or only what has none"),
        Binding("pagedown", "read(1)", "Read on", id="read-on", show=False, priority=True,
                tooltip="Further down in what the check says"),
        Binding("pageup", "read(-1)", "Read back", id="read-back", show=False, priority=True,
                tooltip="Further up in what the check says"),
    ]  # fmt: skip

    def __init__(self) -> None:
        super().__init__()
        self._here = Path.cwd()
        self._files: tuple[Path, ...] | None = None
        self._names: tuple[str, ...] = ()
        self._fresh = self._busy = False
        self._slots = 0
        self._pausing: Timer | None = None
        self._news: int | None = None
        # Held here and not queried: what background tasks bring may come while the screen is being
        # taken down, when there is nothing left to be found by a query.
        self._line = Input(placeholder="parts of the name", id="wanted", compact=True)
        self._list = OptionList(id="files", compact=True)
        self._empty, self._about = StaticText(id="empty"), StaticText(id="about")
        self._picker = Container(id="picker")

    def body(self) -> ComposeResult:
        """The line to type into, the files that fit, what the check says."""
        yield self._line
        yield self._empty
        with self._picker:
            yield self._list
            findings = VerticalScroll(id="findings", can_focus=False)
            findings.border_title = "check "
            with findings:
                yield self._about

    def on_mount(self) -> None:
        """Look for files."""
        self._list.can_focus = False
        self._checks = CheckQueue(
            self.dashboard.background_tasks, self.dashboard.check_file, self._on_checked
        )
        super().on_mount()
        self.set_interval(_AGAIN, self._look_again)
        self.dashboard.background_tasks.start(
            partial(find_files, self._here, is_campaign), self._found, self.dashboard.problem
        )

    def trail(self) -> str:
        """Which folder, how many files, whether everything is run anew."""
        parts = ["submit a campaign", f"{self._here}"]
        if self._files is not None:
            parts.append(f"{len(self._names)} of {count_noun(len(self._files), 'file')}")
        return "  ".join([*parts, *(["everything anew"] if self._fresh else [])])

    def command(self) -> str:
        """Return what to type to submit the file chosen."""
        path = self._chosen()
        name = "CAMPAIGN.yaml" if path is None else relative_name(path, self._here)
        fresh = ("--fresh",) if self._fresh else ()
        return self.dashboard.command_lines.daemon_line("submit", name, *fresh)

    def state_query(self) -> Query:
        """The workers: how many runs at a time."""
        return Query(workers=True)

    def show(self, state: DashboardState) -> None:
        """Have the check ask the ledger of the daemon, when that is on this machine."""
        here = Path(state.overview.state) if state.overview is not None else None
        local = here is not None and StatePaths(here).ledger.is_file()
        self._checks.state = here if local else None
        slots = sum(row.slots for row in state.workers if not row.away)
        if slots != self._slots:
            self._slots = slots
            self._tell()

    def _found(self, files: tuple[Path, ...]) -> None:
        if self.is_attached:
            recent = [path for path in self.dashboard.submitted if path in files]
            self._files = tuple(dict.fromkeys((*recent, *files)))
            self._narrow()

    def on_input_changed(self) -> None:
        """Narrow the files down to what is typed."""
        self._narrow()

    def _narrow(self) -> None:
        """Show the files that fit what is typed."""
        if self._files is None:
            return
        names = tuple(relative_name(path, self._here) for path in self._files)
        self._names = fuzzy_matches(names, self._line.value)
        self._list.clear_options()
        for name in self._names:
            self._list.add_option(Text(name, no_wrap=True, overflow="ellipsis"))
        message = _NONE if not self._files else "" if self._names else "No campaign file fits."
        show_message_or(self._empty, self._picker, message)
        if self._names:
            self._list.highlighted = 0
        self.update_from_state()

    def _chosen(self) -> Path | None:
        index = self._list.highlighted
        if index is None or index >= len(self._names):
            return None
        return self._here / self._names[index]

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        """Check the file the cursor came to, once it rests there."""
        self._news = event.option_index
        self._tell()
        if self._pausing is not None:
            self._pausing.stop()
        self._pausing = self.set_timer(_PAUSE, self._check)

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Submit the file that is clicked on a second time."""
        if self._news == event.option_index:
            self._news = None
        else:
            self.action_submit_file()

    def _check(self) -> None:
        """Check the file under the cursor."""
        path = self._chosen()
        if path is not None:
            self._checks.check(path)

    def _look_again(self) -> None:
        path = self._chosen()
        if path is not None:
            self._checks.look_again(path)

    def _on_checked(self) -> None:
        # The file looked at may have had to wait until another one was checked.
        if self.is_attached:
            self._tell()
            self._check()

    def _tell(self) -> None:
        """Say what the check says of the file under the cursor."""
        path = self._chosen()
        if path is not None:
            found = self._checks.found(path)
            if self._busy or found is None:
                text = Text("… submitting" if self._busy else "… checking", style=QUIET)
            else:
                text = _checked_text(found, self._here)
                append_plan(text, found, relative_name(path, self._here), self._slots, self._fresh)
            text.append("\n\n")
            text.append_text(same_as(self.command()))
            self._about.update(text)

    def action_submit_file(self) -> None:
        """Submit the file, unless something is wrong with it."""
        path = self._chosen()
        if path is None:
            self.notify("there is no campaign file to submit")
        elif not self._busy and self.dashboard.may_steer():
            self._busy = True
            self._tell()
            # The file may have changed since it was checked: what is handed over is read anew.
            self.dashboard.background_tasks.start(
                partial(self.dashboard.check_file, path, submit=True, fresh=self._fresh),
                partial(self._hand_over, path),
                partial(self._refuse, path),
            )

    def _hand_over(self, path: Path, found: CheckedFile) -> None:
        if found.submission is None:
            wrong = [d for d in found.findings if d.severity is Severity.ERROR]
            self._refuse(path, str(wrong[0]) if wrong else "there is nothing to submit")
            return
        command, submission = self.command(), found.submission
        self._busy = False
        self.dashboard.remember(path, submission.campaign)
        self.dashboard.steer(partial(_submit, submission), command)
        if self.is_current:
            self.app.pop_screen()

    def _refuse(self, path: Path, why: str) -> None:
        self._busy = False
        self._checks.forget(path)
        self.dashboard.problem(f"not submitted: {why.splitlines()[0]}")
        self._on_checked()

    def action_move(self, step: int) -> None:
        """Go to another file."""
        move_cursor(self._list, step)

    def action_read(self, pages: int) -> None:
        """Scroll what the check says."""
        findings = self.query_one("#findings", VerticalScroll)
        findings.scroll_relative(y=pages * max(findings.size.height - 1, 1), animate=False)

    def action_fresh(self) -> None:
        """Run everything anew, or only what has no result."""
        self._fresh = not self._fresh
        self._tell()
        self.update_from_state()

    def action_back(self) -> None:
        """Forget what was typed first, then leave."""
        if self._line.value:
            self._line.value = ""
            return
        super().action_back()


def _submit(submission: Submission, daemon: DaemonClient) -> str:
    return receipt_text(daemon.submit(submission))


def append_plan(text: Text, found: CheckedFile, name: str, slots: int, fresh: bool) -> None:
    """Add what would be executed of a file called ``name``, and which searches it has besides."""
    if found.plan is not None:
        text.append(f"\n\n{plan_text(found.plan, slots, fresh=fresh)}")
    if found.searches:
        text.append(f"\n\n{searches_text(Path(name), found.searches)}", style=QUIET)


def _checked_text(found: CheckedFile, here: Path) -> Text:
    """Return what a file is and what was found; other files are named from ``here``."""
    wrong = any(d.severity is Severity.ERROR for d in found.findings)
    about = f"{found.about}, " if found.about else ""
    word = "fail" if wrong else "pass"
    said = f"{GLYPHS[word]} {about}{diagnostic_counts(found.findings)}"
    text = Text.assemble((said, DASHBOARD_STYLES[word]))
    for diagnostic in found.findings:
        where = diagnostic.where
        # Screens are narrow: from here the name is shorter.
        file = relative_name(Path(os.path.normpath(where.file)), here) if where.file else ""
        nearer = replace(diagnostic, where=replace(where, file=file))
        text.append("\n\n").append_text(render_diagnostic(nearer))
    return text
