"""Every screen of the dashboard, of daemons, traces and files that want to steer the terminal."""

import importlib
import pkgutil
from dataclasses import replace

import pytest
from rich.segment import Segment
from textual.color import Color
from textual.screen import Screen

from scenario_tui.dashboard import screens
from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.dialogs import Help, Refusal
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.terminal.filters import PrintableText
from tests.people.dashboard.searching import (
    NEAREST,
    SearchingDaemon,
    make_proposals,
    make_search,
)
from tests.people.dashboard.test_live import Shown
from tests.people.fake import CAMPAIGN, make_live, make_rows
from tests.people.poison import (
    NAME,
    POISON,
    WORD,
    PoisonedDaemon,
    assert_harmless,
    poisoned,
    record_poisoned,
    yaml_text,
)

WIDE = (120, 40)
LOST = "\N{REPLACEMENT CHARACTER}"
DIALOGS = ("c", "r", "number_sign", "D", "question_mark")
"""Keys that open one above the campaigns."""
SEEN = set()
"""The screens that were walked through."""


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_poisoned(tmp_path_factory.mktemp("poisoned") / f"in{NAME}" / "run.mcap")


def look(dash):
    """Check what the terminal would get to show this screen as a whole."""
    screen = dash.screen
    SEEN.add(type(screen))
    update = screen._compositor.render_update(full=True)
    text = assert_harmless(update.render_segments(dash.app.console).encode())
    assert WORD in text or isinstance(screen, Help | Refusal)  # which have words of ours alone


def daemon(trace):
    """Runs 5 and 6 are recorded, run 7 is on its way and waits for something."""
    rows = tuple(replace(r, trace=str(trace)) if r.index in (5, 6) else r for r in make_rows())
    waiting = poisoned(make_live(7, waiting="waiting for planner"))
    live = replace(waiting, run=f"{CAMPAIGN}.7{NAME}")
    return PoisonedDaemon(rows, live=(live,), trouble=f"no space left{POISON}")


async def walk_through_the_dashboard(dashboard, trace, folder):
    (folder / f"bad{NAME}.yaml").write_text(
        f"campaign: x\nabout: {yaml_text(POISON)}\nscenarios: {{{yaml_text(NAME)}: 1}}\n"
    )
    dash = await dashboard(daemon(trace), WIDE)
    app = dash.app
    look(dash)
    for key in DIALOGS:
        await dash.press(key)
        look(dash)
        await dash.press("escape")
    for keys in (("m", "n"), ("a",), ("y",)):
        await dash.press(*keys)
        look(dash)
    assert WORD in app.clipboard
    assert_harmless(app.clipboard.encode())
    for index, parts in ((5, 4), (7, 1), (9, 1)):
        await dash.open("run", f"{CAMPAIGN}.{index}{NAME}")
        for _ in range(parts):
            look(dash)
            await dash.press("tab")
        await dash.press("escape")
    await dash.press("3")
    look(dash)
    app.copy(f"scenario show a{POISON}\nreboot\n")
    assert app.clipboard.splitlines() == [app.clipboard]
    assert_harmless(app.clipboard.encode())
    app.say(f"done{POISON}", f"scenario{POISON}")
    app.problem(f"refused{POISON}")
    await dash.press("colon")
    await dash.pilot.press(*"campaign")
    await dash.settle()
    look(dash)
    await dash.press("escape", "s")
    look(dash)
    await dash.press("down")
    look(dash)


async def walk_through_a_search(dashboard):
    class Poisoned(PoisonedDaemon, SearchingDaemon):
        """A search all of whose texts are poisoned."""

    rows = (*make_proposals(), NEAREST)
    dash = await dashboard(Poisoned(found=(make_search(rows),), proposed=rows), WIDE)
    look(dash)
    await dash.press("enter")
    look(dash)
    await dash.press("x")
    assert_harmless(dash.app.clipboard.encode())
    await dash.press("y", "p")
    look(dash)
    dash.fake.found = (make_search(rows, "failed", note="no such layer"),)
    await dash.press("1")
    look(dash)
    await dash.press("enter")
    look(dash)


async def walk_through_what_moves(dashboard, trace, campaigns):
    playback = open_playback(trace)
    for screen in (
        ReplayScreen(playback, 0.6, clock=lambda: 0.0),
        CompareScreen(playback, playback, clock=lambda: 0.0),
    ):
        look(await dashboard(StandaloneApp(screen), WIDE))
    world = Shown(campaigns, to_type=f"relay{NAME}")
    world.connected = [f"Foxglove {POISON}"]
    dash = await dashboard(world.app, WIDE)
    await world.passes(dash, 1.0)
    look(dash)


async def test_no_screen_lets_it_through(dashboard, trace, tmp_path, campaigns, monkeypatch):
    monkeypatch.chdir(tmp_path)
    await walk_through_the_dashboard(dashboard, trace, tmp_path)
    await walk_through_a_search(dashboard)
    await walk_through_what_moves(dashboard, trace, campaigns)
    for module in pkgutil.iter_modules(screens.__path__):
        importlib.import_module(f"{screens.__name__}.{module.name}")
    assert set(_concrete(Screen)) <= SEEN


def _concrete(kind):
    """Return the screens of ours that no other one is made of."""
    for below in kind.__subclasses__():
        yield from _concrete(below)
        if not below.__subclasses__() and below.__module__.startswith(screens.__name__):
            yield below


def test_a_line_stays_as_wide_as_it_was():
    def shown(*texts):
        lines = PrintableText().apply([Segment(text) for text in texts], Color(0, 0, 0))
        return [segment.text for segment in lines]

    assert shown("plain", "  text") == ["plain", "  text"]
    # Blanks behind it make room, so that the next column stays where it is.
    assert shown("a\x1bb\u202e   c", "  d") == [f"a{LOST}b{LOST} c", "  d"]
    assert shown("\x1b[2J", "   d") == [f"{LOST}[2J", "  d"]
    # Where there are none it goes without a trace.
    assert shown("a\x1bb\u202ec d") == ["abc d"]
    assert shown("tab\there   ") == [f"tab{LOST}here  "]
