"""Our colours can be read: on every background they stand on, on dark and on light terminals."""

from functools import cache

import pytest
from rich.color_triplet import ColorTriplet
from textual._context import visible_screen_stack
from textual.color import Color

from grammars.text.diagnostics import Finding, Severity, Where
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.themes import DARK, LIGHT
from scenario_tui.library import submission
from scenario_tui.library.submission import CheckedFile
from scenario_tui.terminal.capabilities import TerminalLimits
from scenario_tui.terminal.filters import darken
from scenario_tui.text.styles import COLOURS
from tests.people.dashboard.daemons import judged_campaign
from tests.people.dashboard.dash import make_dashboard
from tests.people.dashboard.searching import SearchingDaemon
from tests.people.fake import FakeDaemon

LEAST = 4.5
"""The contrast that the WCAG asks for between a text and its background."""
DRAWN = range(0x2500, 0x2900)
"""Lines, blocks and braille: drawings, not text."""
SCREENS = ((), ("enter",), ("m",), ("enter", "enter"), ("question_mark",), ("c",), ("r",), ("s",))


WHERE = Where("first.yaml", 1, 1)
CHECKED = CheckedFile(
    "first: 4 runs",
    (
        Finding(WHERE, "something is wrong", "write it right"),
        Finding(WHERE, "something is odd", severity=Severity.WARNING),
    ),
)


def luminance(colour):
    """Relative luminance as the WCAG defines it."""
    parts = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in colour.normalized]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


@cache
def contrast(style):
    both = (luminance(colour.get_truecolor()) for colour in (style.color, style.bgcolor))
    low, high = sorted(both)
    return (high + 0.05) / (low + 0.05)


def is_text(segment):
    written = segment.text.strip()
    style = segment.style
    coloured = style is not None and style.color is not None and style.bgcolor is not None
    return coloured and any(ord(sign) not in DRAWN for sign in written)


def drawn(dash):
    """Return the lines of the screen in front and, around dialogs, of what is behind it."""
    screen = dash.screen
    screen.refresh()
    visible_screen_stack.set(dash.app._background_screens)
    return dash.strips


def poor(dash):
    """Return the texts on the screen that cannot be read, with their style."""
    segments = [one for strip in drawn(dash) for one in strip if is_text(one)]
    return {one.text.strip(): one.style for one in segments if contrast(one.style) < LEAST}


async def assert_readable(dash, place):
    """Check all texts of the screen in the theme it has, and in the other one of ours."""
    for theme in sorted((DARK, LIGHT), key=lambda one: one != dash.app.theme):
        dash.app.theme = theme
        await dash.settle()
        assert poor(dash) == {}, (theme, place)


async def test_every_text_can_be_read(dashboard, tmp_path, monkeypatch):
    (tmp_path / "first.yaml").write_text("campaign: first\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(submission, "check_file", lambda *_, **__: CHECKED)
    dash = await dashboard(judged_campaign(), (120, 40), config=Config(theme=DARK))
    home = dash.screen
    for keys in SCREENS:
        await dash.press(*keys)
        await assert_readable(dash, keys)
        while dash.screen is not home:
            await dash.press("escape")
    dash = await dashboard(SearchingDaemon.finished(), (120, 40))
    await dash.press("enter")
    await assert_readable(dash, "a search")


STATES = ("gone", "c", "colon")
"""What takes the keys from a screen: that no daemon answers, a key that opens a dialog, places."""


@pytest.mark.parametrize("theme", [DARK, LIGHT])
async def test_what_is_old_or_behind_a_dialog_can_be_read(dashboard, theme):
    fake = judged_campaign()
    dash = await dashboard(fake, (120, 40), config=Config(theme=theme))
    for keys in (("m",), ("1", "enter", "enter")):
        await dash.press(*keys)
        shown, first, rows = dash.screen, dash.lines[0], dash.lines[3:6]
        for state in STATES:
            if state == "gone":
                fake.reachable = False
                await dash.settle()
                assert shown.has_class("-stale")
                assert "no daemon answers" in dash.lines[0]
            else:
                await dash.press(state)
                assert dash.screen is not shown
                if state == "colon":
                    await dash.until(lambda: any("Quit" in one.text for one in drawn(dash)[4:-1]))
                    assert drawn(dash)[0].text.rstrip() == first
                else:
                    seen = [strip.text[:10] for strip in drawn(dash)[3:6]]
                    assert seen == [f"{row:10}"[:10] for row in rows]
            assert poor(dash) == {}, state
            fake.reachable = True
            if dash.screen is not shown:
                await dash.press("escape")
            await dash.settle()
            assert not {"-stale", "-behind"} & shown.classes


@pytest.mark.parametrize(("theme", "colours"), [(DARK, "few"), (LIGHT, "none")])
async def test_the_selection_is_seen_without_our_colours(dashboard, theme, colours):
    app = make_dashboard(FakeDaemon(), config=Config(theme=theme))
    app.apply_limits(TerminalLimits(colours))
    dash = await dashboard(app)
    await dash.press("down")
    reverse = [any(s.style and s.style.reverse for s in strip) for strip in dash.strips]
    assert [row for row, lit in enumerate(reverse) if lit] == [4]
    await dash.press("d")
    behind = drawn(dash)[4]
    assert any(segment.style and segment.style.reverse for segment in behind)


async def test_our_theme_follows_the_terminal_unless_one_was_chosen(dashboard, monkeypatch):
    monkeypatch.setenv("COLORFGBG", "0;15")
    app = make_dashboard(FakeDaemon())
    assert app.theme == DARK
    app.limit_to_terminal()
    assert app.theme == LIGHT
    chosen = make_dashboard(FakeDaemon(), config=Config(theme="nord"))
    chosen.limit_to_terminal()
    await dashboard(chosen)
    assert chosen.theme == "nord"


PALE = {name: Color.parse(colour).rich_color.get_truecolor() for name, colour in COLOURS.items()}


@pytest.mark.parametrize("colour", PALE.values(), ids=PALE)
def test_words_can_be_read_in_bright_themes(colour):
    dark = darken(Color(*colour)).rich_color.get_truecolor()
    paper, ink = luminance(ColorTriplet(224, 224, 224)), luminance(dark)  # of textual-light
    assert (paper + 0.05) / (ink + 0.05) >= LEAST


async def test_a_bright_theme_darkens_the_words(dashboard):
    dash = await dashboard(config=Config(theme="textual-light"))
    styles = [segment.style for strip in dash.strips for segment in strip if segment.style]
    used = {style.color.get_truecolor() for style in styles if style.color is not None}
    assert not used & set(PALE.values())
    assert darken(Color(*PALE["bad"])).rich_color.get_truecolor() in used


@pytest.mark.parametrize(
    ("name", "behind", "keys"),
    [("runs", FakeDaemon, "enter j j j j j"), ("matrix", judged_campaign, "m n")],
)
async def test_words_have_their_colours(dashboard, golden, name, behind, keys):
    dash = await dashboard(behind())
    await dash.press(*keys.split())
    lines = [
        "".join(f"{segment.style}: {segment.text}\n" for segment in strip if segment.text.strip())
        for strip in dash.strips
    ]
    golden(f"screens/{name}-colours.txt", "\n".join(lines))
