"""Our colours can be read: on every background they stand on, on dark and on light terminals."""

import pytest
from textual._context import visible_screen_stack
from textual.css.stylesheet import Stylesheet

from grammars.text.diagnostics import Finding, Severity, Where
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.themes import DARK, LIGHT
from scenario_tui.library import submission
from scenario_tui.library.submission import CheckedFile
from scenario_tui.terminal.capabilities import TerminalLimits
from tests.people.dashboard.driven import SteeredDaemon
from tests.people.dashboard.inline import make_dashboard
from tests.people.dashboard.judged_campaign import judged_campaign
from tests.people.dashboard.searching import SearchingDaemon

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


def contrast(segment):
    style = segment.style
    assert style is not None
    assert style.color is not None
    assert style.bgcolor is not None
    both = (luminance(c.get_truecolor()) for c in (style.color, style.bgcolor))
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
    return list(screen._compositor.render_strips())


def poor(dash):
    for strip in drawn(dash):
        for segment in strip:
            if is_text(segment) and contrast(segment) < LEAST:
                yield segment.text.strip(), f"{contrast(segment):.2f} {segment.style}"


@pytest.mark.parametrize("theme", [DARK, LIGHT])
async def test_every_text_can_be_read(dashboard, theme, tmp_path, monkeypatch):
    (tmp_path / "first.yaml").write_text("campaign: first\n")
    monkeypatch.chdir(tmp_path)
    config = Config(theme=theme)
    monkeypatch.setattr(submission, "check_file", lambda *_, **__: CHECKED)
    app = make_dashboard(judged_campaign(), config=config)
    dash = await dashboard(app, (120, 40))
    home = dash.screen
    for keys in SCREENS:
        await dash.press(*keys)
        assert dict(poor(dash)) == {}, keys
        while dash.screen is not home:
            await dash.press("escape")


@pytest.mark.parametrize("theme", [DARK, LIGHT])
async def test_a_search_and_the_banner_of_a_lost_connection_can_be_read(dashboard, theme):
    fake = SearchingDaemon.finished()
    dash = await dashboard(fake, config=Config(theme=theme), size=(120, 40))
    await dash.press("enter")
    assert dict(poor(dash)) == {}
    await dash.press("escape")
    fake.reachable = False
    await dash.settle()
    assert "no daemon answers" in dash.lines[0]
    banner = next(iter(dash.screen._compositor.render_strips()))
    assert all(contrast(one) >= LEAST for one in banner if is_text(one))


STATES = ("gone", "question_mark", "c")
"""What takes the keys from a screen: that no daemon answers, and keys that open dialogs."""


@pytest.mark.parametrize("theme", [DARK, LIGHT])
@pytest.mark.parametrize("keys", [(), ("enter",), ("m",), ("enter", "enter")])
async def test_what_is_old_or_behind_a_dialog_can_be_read(dashboard, theme, keys):
    fake = judged_campaign()
    dash = await dashboard(fake, config=Config(theme=theme), size=(120, 40))
    await dash.press(*keys)
    shown = dash.screen
    rows = dash.lines[3:6]
    for state in STATES:
        if state == "gone":
            fake.reachable = False
            await dash.settle()
            assert shown.has_class("-stale")
        else:
            await dash.press(state)
            assert dash.screen is not shown
            seen = [strip.text[:10] for strip in drawn(dash)[3:6]]
            assert seen == [f"{row:10}"[:10] for row in rows]
        assert dict(poor(dash)) == {}, state
        fake.reachable = True
        if dash.screen is not shown:
            await dash.press("escape")
        assert not {"-stale", "-behind"} & shown.classes


@pytest.mark.parametrize("theme", [DARK, LIGHT])
@pytest.mark.parametrize("keys", [(), ("enter",), ("m",), ("enter", "enter")])
async def test_the_palette_and_what_is_behind_it_can_be_read(dashboard, theme, keys):
    app = make_dashboard(judged_campaign(), config=Config(theme=theme))
    dash = await dashboard(app, (120, 40))
    await dash.press(*keys)
    behind = dash.lines[0]
    await dash.press("colon")
    await dash.until(lambda: any("Quit" in strip.text for strip in drawn(dash)[4:-1]))
    assert drawn(dash)[0].text.rstrip() == behind
    assert dict(poor(dash)) == {}


@pytest.mark.parametrize("theme", [DARK, LIGHT])
@pytest.mark.parametrize("colours", ["few", "none"])
async def test_the_selection_is_seen_without_our_colours(dashboard, theme, colours):
    app = make_dashboard(SteeredDaemon(), config=Config(theme=theme))
    app.apply_limits(TerminalLimits(colours))
    dash = await dashboard(app)
    await dash.press("down")
    strips = list(dash.screen._compositor.render_strips())
    reverse = [any(s.style and s.style.reverse for s in strip) for strip in strips]
    assert [row for row, lit in enumerate(reverse) if lit] == [4]
    await dash.press("d")
    behind = drawn(dash)[4]
    assert any(segment.style and segment.style.reverse for segment in behind)


async def test_our_theme_follows_the_terminal_unless_one_was_chosen(monkeypatch):
    monkeypatch.setenv("COLORFGBG", "0;15")
    app = make_dashboard(SteeredDaemon())
    assert app.theme == DARK
    app.limit_to_terminal()
    assert app.theme == LIGHT
    chosen = make_dashboard(SteeredDaemon(), config=Config(theme="nord"))
    chosen.limit_to_terminal()
    async with chosen.run_test(size=(80, 24)):
        assert chosen.theme == "nord"


async def test_style_sheets_are_parsed_once_before_the_first_screen(dashboard, monkeypatch):
    parsed = []
    parse = Stylesheet.reparse
    monkeypatch.setattr(Stylesheet, "reparse", lambda sheet: parsed.append(sheet) or parse(sheet))
    dash = await dashboard(SteeredDaemon(), config=Config())
    assert not parsed  # they are when the first screen asks for them
    dash.app.theme = LIGHT
    await dash.settle()
    assert len(parsed) == 1
    assert dash.screen.background_colors[1].hex == "#FBFBF9"
