"""Pictures of every view of the dashboard for the documentation: executed runs, at a fixed time.

``python -m campaigns.studies.pictures`` writes them, the tests compare their texts.
"""

from __future__ import annotations

import html
import os
import re
import shutil
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, chdir
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

from rich.console import Console
from textual.app import App
from textual.command import CommandList
from textual.keys import format_key
from textual.pilot import Pilot
from textual.widgets import Input, Static

from campaigns.studies.pictures.executed_campaign import (
    FAILED,
    PASSED,
    ExecutedCampaign,
    ExecutedDaemon,
    trace_of,
)
from scenario_tui.cli import invoke
from scenario_tui.dashboard.key_bindings import list_key_bindings
from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.run_watch import Tracks
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.widgets.map_style import MapSigns
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.source import DaemonTarget
from scenario_tui.terminal import printable_console
from scenario_tui.text.styles import terminal_theme
from tests.people.dashboard.dash import eventually, make_dashboard, press, settle
from tests.people.dashboard.searching import SEARCH, SearchingDaemon
from tests.people.recorded import record_run

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "docs" / "pictures"
CAMPAIGNS = ROOT / "campaigns"
KEYS = "## All keys\n\n"
"""Heading of the table of keys."""
HERE = Path("robot")
"""Working directory of the dashboard."""
NARROW = (92, 26)
WIDE = (126, 32)
_TEXT = re.compile(r'<text class="[^"]*" x="([\d.]+)" y="([\d.]+)"[^>]*>(.*?)</text>')


def _executed(folder, executed):
    dashboard = make_dashboard(ExecutedDaemon.of(executed))
    # On a busy machine the dashboard would show the age of the last message.
    dashboard.tracks = Tracks(clock=lambda: 0.0)
    return dashboard


def _replay(folder, executed):
    playback = open_playback(Path(trace_of(FAILED)))
    touched = next(verdict for verdict in playback.verdicts if verdict.oracle == "no-contact")
    assert touched.evidence.time is not None
    return StandaloneApp(ReplayScreen(playback, touched.evidence.time - 0.5, clock=lambda: 0.0))


def _compared(folder, executed):
    first, second = (open_playback(Path(trace_of(name))) for name in (FAILED, PASSED))
    return StandaloneApp(CompareScreen(first, second, clock=lambda: 0.0))


def _submitting(folder, executed):
    for name in ("demo", "ortega2024", "robots", "suts"):
        shutil.copytree(CAMPAIGNS / name, folder / HERE / name)
    for age, path in enumerate(sorted(folder.rglob("*.yaml"))):
        os.utime(path, (1e9 - age, 1e9 - age))
    return _executed(folder, executed)


async def _checked(pilot):
    await eventually(
        lambda: "✓" in str(pilot.app.screen.query_one("#about", Static).render()), pilot
    )


async def _listed(pilot):
    counts = []

    def settled():
        counts.append(pilot.app.screen.query_one(CommandList).option_count)
        return len(counts) > 20 and len(set(counts[-20:])) == 1 and counts[-1] > 1

    await eventually(settled, pilot)


async def _read(pilot):
    await eventually(lambda: pilot.app.screen.transport, pilot)


async def _mapped(pilot):
    await eventually(lambda: pilot.app.screen.query_one(TopView).display, pilot)


def _searching(folder, executed):
    return make_dashboard(SearchingDaemon.running())


def _search_over(folder, executed):
    fake = SearchingDaemon.finished()
    path = record_run(Path("state") / f"{SEARCH}.37.mcap")
    verdicts = open_playback(path).verdicts
    fake.proposed = tuple(
        replace(row, trace=str(path), result=replace(row.result, verdicts=verdicts))
        if row.id == f"{SEARCH}.37"
        else row
        for row in fake.proposed
    )
    return make_dashboard(fake)


async def _gone(pilot):
    fake = pilot.app.feed.fake
    fake.reachable = False
    fake.now += 75.0
    await settle(pilot)


@dataclass(frozen=True)
class Shot:
    """A picture: the application, its size, and the keys that lead to the view."""

    keys: tuple[str, ...] = ()
    size: tuple[int, int] = NARROW
    open: Callable[[Path, ExecutedCampaign], App[Any]] = _executed
    before: Callable[[Pilot[Any]], Awaitable[None]] | None = None


_TO_FAILED = ("enter", *["j"] * 8)
_TO_LIVE = ("enter", *["j"] * 10)

SHOTS = {
    "campaigns": Shot(),
    "matrix": Shot(("m", "n")),
    "runs": Shot(_TO_FAILED, WIDE),
    "all-runs": Shot(("2",), (99, 26)),
    "run": Shot((*_TO_FAILED, "enter"), before=_read),
    "timeline": Shot((*_TO_FAILED, "enter", "tab"), before=_read),
    "finished": Shot((*_TO_FAILED, "enter"), (150, 42), before=_read),
    "live": Shot((*_TO_LIVE, "enter"), (126, 40)),
    "replay": Shot(open=_replay),
    "comparison": Shot(("n",), (112, 27), open=_compared),
    "searches": Shot(open=_searching),
    "search": Shot(("enter",), (110, 25), open=_search_over, before=_mapped),
    "parameters": Shot(("enter", "n", "n", "tab"), open=_search_over),
    "submit": Shot(("s",), open=_submitting, before=_checked),
    "workers": Shot(("3",)),
    "help": Shot(("enter", "question_mark")),
    "palette": Shot(("colon", *"re"), before=_listed),
    "cancel": Shot(("c",)),
    "gone": Shot(before=_gone),
}

_TRACE = f"{FAILED.replace('/', '.')}.mcap"
COMMANDS = {
    "command-status": ("status",),
    "command-results": ("results",),
    "command-show": ("show", "demo.8"),
    "command-logs": ("show", _TRACE, "--log"),
    "command-plot": ("plot", _TRACE, "clearance", "speed"),
    "command-frame": ("replay", _TRACE, "--frame", "no-contact"),
}
"""Commands with a picture of their output, about the dashboard's data and a trace beside them."""


def typed(name, folder, executed):
    """Return the output of a command about the runs of ``executed`` as SVG, typed in ``folder``."""
    arguments = COMMANDS[name]
    width, height = 80, 26
    environment = {
        "COLUMNS": str(width),
        "LINES": str(height),
        "SCENARIO_CONNECT": "tcp/127.0.0.1:7447",
    }
    with Path(os.devnull).open("w") as nowhere, chdir(folder), ExitStack() as patched:
        _put_traces(folder, executed)
        Path(_TRACE).symlink_to(trace_of(FAILED))
        fake = ExecutedDaemon.of(executed)
        console = Console(
            record=True, width=width, file=nowhere, force_terminal=True, color_system="truecolor",
            highlight=False, legacy_windows=False, theme=terminal_theme(),
        )  # fmt: skip
        line = f"scenario {' '.join(arguments)}"
        console.print(f"$ {line}", markup=False, style="bold")
        for patch in (
            mock.patch.object(DaemonTarget, "open", side_effect=fake.open),
            mock.patch.object(DaemonTarget, "read", side_effect=fake.open),
            mock.patch.object(printable_console, "open_console", return_value=console),
            mock.patch.dict(os.environ, environment),
        ):
            patched.enter_context(patch)
        assert invoke(arguments) == 0
        return _slim(console.export_svg(title=line, unique_id=name))


async def draw(name, folder, executed):
    """Return a view of ``executed`` as SVG; ``folder`` is for its files."""
    shot = SHOTS[name]
    _put_traces(folder, executed)
    # Relative paths are the same everywhere.
    with chdir(folder), mock.patch.object(Path, "cwd", return_value=HERE):
        app = shot.open(folder, executed)
        async with app.run_test(size=shot.size) as pilot:
            await pilot.pause(0)
            if hasattr(app, "update_state"):
                await settle(pilot)
                await press(pilot, *shot.keys)
            else:
                await pilot.press(*shot.keys)
                await pilot.pause(0)
            if shot.before is not None:
                await shot.before(pilot)
            for line in app.screen.query(Input):
                line.cursor_blink = False
            # The legend would keep signs of maps that were painted on the way here.
            for top in app.screen.query(TopView):
                top.signs = MapSigns()
                top.redraw()
            for _ in range(2):
                app.export_screenshot()
                await (settle(pilot) if hasattr(app, "update_state") else pilot.pause(0))
            svg = app.export_screenshot(title=f"scenario tui: {name}")
    return _slim(svg.replace(_identifier(svg), name))


def _put_traces(folder, executed):
    """Link the traces into the state directory of a daemon in ``folder``."""
    (folder / "state").symlink_to(executed.folder / "state")


def _identifier(svg):
    """Return the common beginning of all names in a picture, which depends on its content."""
    match = re.search(r"terminal-[0-9]+", svg)
    assert match is not None
    return match[0]


def _slim(svg):
    """Remove clips that cut lines of text off where they end anyway."""
    svg = re.sub(r' clip-path="url\(#[^)]*-line-\d+\)"', "", svg)
    svg = re.sub(r'<clipPath id="[^"]*-line-\d+">\s*<rect[^>]*/>\s*</clipPath>\s*', "", svg)
    return re.sub(r"\n\s*", "\n", svg)


def key_table():
    """Return every key of the dashboard, at the widest place, as a table of the documentation."""
    rows = {}
    for bound in list_key_bindings():
        keys = " ".join(f"`{format_key(key)}`" for key in bound.keys.split(","))
        row = f"| {keys} | {bound.id} | {bound.place} | {bound.meaning} |"
        rows.setdefault((bound.keys, bound.id, bound.meaning), row)
    return "\n".join(
        ("| keys | id | where | what it does |", "|---|---|---|---|", *rows.values(), "")
    )


def visible(svg):
    """Return the lines of text in a picture, without colours and identifiers."""
    lines = {}
    for x, y, text in _TEXT.findall(svg):
        lines.setdefault(float(y), []).append((float(x), html.unescape(text)))
    joined = ("".join(text for _, text in sorted(parts)) for _, parts in sorted(lines.items()))
    return [line.replace("\xa0", " ").rstrip() for line in joined]
