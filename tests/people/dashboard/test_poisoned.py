"""Every screen of the dashboard, of daemons, traces and files that want to steer the terminal."""

import importlib
import pkgutil
import sys
from dataclasses import replace

import pytest
from rich.segment import Segment
from textual.color import Color
from textual.screen import Screen
from textual.validation import Integer

from scenario_tui.dashboard import screens
from scenario_tui.dashboard.playback import open_playback
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.dialogs import Menu, MenuChoice, Prompt, Question, Refusal
from scenario_tui.dashboard.screens.help import Help
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.screens.search import SearchScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.screens.submit import SubmitScreen
from scenario_tui.dashboard.screens.workers import WorkersScreen
from scenario_tui.terminal.filters import PrintableText
from tests.people.dashboard.inline import make_dashboard, press, settle
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
from tests.people.terminal.pseudo_terminal import terminal

WIDE = (120, 40)
LOST = "\N{REPLACEMENT CHARACTER}"
SEEN = set()
"""The screens that were walked through."""


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_poisoned(tmp_path_factory.mktemp("poisoned") / f"in{NAME}" / "run.mcap")


def look(pilot, kind=None):
    """Check what the terminal would get to show this screen as a whole; return the text."""
    screen = pilot.app.screen
    SEEN.add(type(screen))
    assert kind is None or type(screen) is kind
    update = screen._compositor.render_update(full=True)
    text = assert_harmless(update.render_segments(pilot.app.console).encode())
    assert WORD in text or kind is Help  # which has words of ours alone
    return text


def daemon(trace):
    """Runs 5 and 6 are recorded, run 7 is on its way and waits for something."""
    rows = tuple(replace(r, trace=str(trace)) if r.index in (5, 6) else r for r in make_rows())
    waiting = poisoned(make_live(7, waiting="waiting for planner"))
    live = replace(waiting, run=f"{CAMPAIGN}.7{NAME}")
    return PoisonedDaemon(rows, live=(live,), trouble=f"no space left{POISON}")


async def walk_through_the_dashboard(trace, folder):
    (folder / f"bad{NAME}.yaml").write_text(
        f"campaign: x\nabout: {yaml_text(POISON)}\nscenarios: {{{yaml_text(NAME)}: 1}}\n"
    )
    dashboard = make_dashboard(daemon(trace))
    async with dashboard.run_test(size=WIDE) as pilot:
        await settle(pilot)
        look(pilot)
        await press(pilot, "m", "n")
        look(pilot, MatrixScreen)
        await press(pilot, "a")
        look(pilot, RunsScreen)
        await press(pilot, "y")  # what is copied is said
        look(pilot)
        assert WORD in dashboard.clipboard
        assert_harmless(dashboard.clipboard.encode())
        for index, parts in ((5, 4), (7, 1), (9, 1)):
            dashboard.open("run", f"{CAMPAIGN}.{index}{NAME}")
            await settle(pilot)
            for _ in range(parts):
                look(pilot, RunScreen)
                await press(pilot, "tab")
            await press(pilot, "escape")
        await press(pilot, "3")
        look(pilot, WorkersScreen)
        dashboard.copy(f"scenario show a{POISON}\nreboot\n")
        assert dashboard.clipboard.splitlines() == [dashboard.clipboard]
        assert_harmless(dashboard.clipboard.encode())
        dashboard.say(f"done{POISON}", f"scenario{POISON}")
        dashboard.problem(f"refused{POISON}")
        await press(pilot, "colon", *"campaign")
        look(pilot)
        await press(pilot, "escape", "s")
        look(pilot, SubmitScreen)
        await press(pilot, "down")
        look(pilot)


async def walk_through_a_search(trace):
    class Poisoned(PoisonedDaemon, SearchingDaemon):
        """A search all of whose texts are poisoned."""

    rows = (*make_proposals(), NEAREST)
    for search in (make_search(rows), make_search(rows, "failed", note="no such layer")):
        dashboard = make_dashboard(Poisoned(found=(search,), proposed=rows))
        async with dashboard.run_test(size=WIDE) as pilot:
            await settle(pilot)
            look(pilot)
            await press(pilot, "enter")
            assert WORD in look(pilot, SearchScreen)
            await press(pilot, "x")
            assert_harmless(dashboard.clipboard.encode())
            await press(pilot, "y", "p")
            look(pilot)


async def walk_through_dialogs(trace):
    dashboard = make_dashboard(daemon(trace))
    dialogs = (
        Question(f"sure?{POISON}", f"scenario cancel {NAME}"),
        Menu(f"which?{POISON}", [MenuChoice("a", "1", f"this{POISON}", NAME)], f"note{POISON}"),
        Prompt(f"what?{POISON}", f"value{NAME}", Integer(0, 0, f"wrong{NAME}"), lambda _: NAME),
        Refusal(f"no{POISON}"),
    )
    async with dashboard.run_test(size=WIDE) as pilot:
        await settle(pilot)
        for dialog in dialogs:
            dashboard.push_screen(dialog)
            await settle(pilot)
            look(pilot, type(dialog))
            dashboard.pop_screen()
        await press(pilot, "question_mark")
        look(pilot, Help)


async def walk_through_what_moves(trace, campaigns):
    playback = open_playback(trace)
    for screen in (
        ReplayScreen(playback, 0.6, clock=lambda: 0.0),
        CompareScreen(playback, playback, clock=lambda: 0.0),
    ):
        async with StandaloneApp(screen).run_test(size=WIDE) as pilot:
            await pilot.pause(0)
            look(pilot, type(screen))
    shown = Shown(campaigns, to_type=f"relay{NAME}")
    shown.connected = [f"Foxglove {POISON}"]
    async with StandaloneApp(shown.screen).run_test(size=WIDE) as pilot:
        await shown.passes(pilot, 1.0)
        look(pilot, type(shown.screen))


async def test_no_screen_lets_it_through(trace, tmp_path, campaigns, monkeypatch):
    monkeypatch.chdir(tmp_path)
    await walk_through_the_dashboard(trace, tmp_path)
    await walk_through_a_search(trace)
    await walk_through_dialogs(trace)
    await walk_through_what_moves(trace, campaigns)
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


PROGRAM = """
import sys
from scenario_tui.cli import main
from scenario_tui.source import DaemonTarget
from tests.people.poison import PoisonedDaemon
fake = PoisonedDaemon(trouble="no space left")
DaemonTarget.open = lambda self: fake.open()
main(["tui", "--connect", "tcp/127.0.0.1:9"])
"""


def test_what_the_dashboard_sends_a_real_terminal_is_its_own():
    with terminal([sys.executable, "-c", PROGRAM], columns=120, rows=40) as shown:
        shown.until("nightly-00ff00f")
        shown.type("\r")
        shown.until(f"S1{LOST}")
        shown.type("\r")
        shown.until("took")
        shown.type("q")
        assert shown.wait() == 0
        assert WORD.encode() in shown.raw
        # Cleared once, by us, before there is anything to see.
        assert_harmless(bytes(shown.raw).replace(b"\x1b[2J\x1b[1;2H", b""))
