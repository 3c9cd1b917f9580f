"""What is made of recorded runs from the dashboard: another judgement, a report."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.batch.paths import StatePaths
from grammars.text.words import command_line
from scenario_tui.campaign_files import find_files, relative_name
from scenario_tui.dashboard.background import CommandAnswer
from scenario_tui.dashboard.screens.dialogs import Menu, TextDialog, numbered_choices

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow
    from scenario_tui.dashboard.base_app import BaseDashboard

_SSH: Final = ("SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY")
_DISPLAYS: Final = ("DISPLAY", "WAYLAND_DISPLAY")
_OPENERS: Final = ("xdg-open", "open")
ENDING: Final = ".oracles.yaml"


def judge_again(dashboard: BaseDashboard, row: CampaignRow, what: str) -> None:
    """Ask by which oracles, judge what was recorded of a campaign by them, show what changes.

    ``what`` is the campaign's id for all its runs, or that of one.
    """
    state = _state(dashboard, row)
    if state is None:
        return
    here = Path.cwd()
    find = partial(find_files, here, lambda path: path.name.endswith(ENDING))
    dashboard.background_tasks.start(
        find, lambda files: _choose_oracles(dashboard, what, state, files, here), dashboard.problem
    )


def _choose_oracles(
    dashboard: BaseDashboard, what: str, state: Path, files: Sequence[Path], here: Path
) -> None:
    own = dashboard.command_lines.local_arguments(state, "judge", what)
    ways = [("the oracles it was submitted with", own)]
    for file in files:
        name = relative_name(file, here)
        ways.append(
            (name, dashboard.command_lines.local_arguments(state, "judge", what, "--oracles", name))
        )
    choices = numbered_choices([(words, command_line(*way)) for words, way in ways], 0)

    def decided(index: int | None) -> None:
        if index is not None:
            done = partial(_tell_judged, dashboard, command_line(*ways[index][1]))
            _ask(dashboard, f"judging {what} again", ways[index][1], done)

    dashboard.push_screen(Menu(f"Judge {what} again by", choices), decided)


def _tell_judged(dashboard: BaseDashboard, command: str, answer: CommandAnswer) -> None:
    from rich.console import Group

    from daemon.analysis.rejudge import Rejudgement
    from grammars.text.codec import from_plain
    from scenario_tui.text.comparison_text import rejudge_parts

    parts = rejudge_parts(from_plain(Rejudgement, answer).traces)
    dashboard.push_screen(TextDialog(Group(*parts), command))


def make_report(dashboard: BaseDashboard, row: CampaignRow) -> None:
    """Write the report of a campaign, say where it is, show it where that can be seen."""
    state = _state(dashboard, row)
    if state is None:
        return
    page = f"{row.id}.html"
    way = dashboard.command_lines.local_arguments(state, "report", row.id, "-o", page)
    doing = f"writing the report of {row.id}"
    if doing in dashboard.running_jobs:
        dashboard.notify(f"… {doing} already", markup=False)
        return
    dashboard.running_jobs.add(doing)
    done = partial(_tell_report, dashboard, Path.cwd() / page, command_line(*way), doing)
    _ask(dashboard, doing, way, done)


def _tell_report(
    dashboard: BaseDashboard, page: Path, command: str, doing: str, answer: CommandAnswer
) -> None:
    dashboard.running_jobs.discard(doing)
    opened = open_in_browser(page, os.environ)
    where = "opened in the browser" if opened else "open it in a browser"
    dashboard.say(f"{answer['answer']}\n{page} ({where})", command)


def _ask(
    dashboard: BaseDashboard,
    doing: str,
    way: tuple[str, ...],
    then: Callable[[CommandAnswer], None],
) -> None:
    dashboard.say(f"{doing} …", command_line(*way))

    def failed(why: str) -> None:
        dashboard.running_jobs.discard(doing)
        dashboard.problem(why)

    dashboard.background_tasks.start(partial(dashboard.run_command, way), then, failed)


def _state(dashboard: BaseDashboard, row: CampaignRow) -> Path | None:
    """Return the state directory with the traces; say so when it is not on this machine."""
    overview = dashboard.daemon_state.overview
    state = Path(overview.state) if overview is not None else None
    if state is None or not StatePaths(state).ledger.is_file():
        where = "" if state is None else f" ({state} on the daemon's machine)"
        dashboard.problem(f"the traces of {row.id} are not on this machine{where}")
        return None
    if not row.done:
        dashboard.notify(f"no run of {row.id} has a result yet")
        return None
    return state


def has_display(environ: Mapping[str, str]) -> bool:
    """Whether somebody sits at this machine's own screen; never over SSH."""
    # Even with a forwarded display: a browser over the line is not what anybody waits for.
    if any(environ.get(name) for name in _SSH):
        return False
    return sys.platform == "darwin" or any(environ.get(name) for name in _DISPLAYS)


def open_in_browser(page: Path, environ: Mapping[str, str]) -> bool:
    """Open a page in the browser of this machine's screen; return whether there is one."""
    opener = next(filter(None, map(shutil.which, _OPENERS)), None)
    if opener is None or not has_display(environ):
        return False
    # A browser outlives the dashboard and must not write over it.
    subprocess.Popen(
        [opener, page.as_uri()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    return True
