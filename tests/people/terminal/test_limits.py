"""Poor terminals: few colours, none, ASCII only; what is found out and what is made of it."""

from types import SimpleNamespace

import pytest
from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual.color import Color

from scenario_tui.terminal import capabilities
from scenario_tui.terminal.capabilities import (
    TerminalLimits,
    ascii_only,
    light_background,
    terminal_limits,
    why_undrawable,
)
from scenario_tui.terminal.filters import AsciiGlyphs, ReducedColours, reduce_style
from scenario_tui.text.ascii_signs import to_ascii
from scenario_tui.text.styles import GLYPHS, dashboard_theme

BLACK = Color.parse("#121212")


def test_a_dumb_terminal_is_refused_with_what_to_do_and_others_are_drawn_on():
    for name in ("dumb", "unknown", ""):
        said = why_undrawable({"TERM": name})
        assert "cannot show drawings" in said
        assert "scenario status" in said
    for name in ("xterm", "linux", "screen", "vt100", "tmux-256color"):
        assert why_undrawable({"TERM": name}) == ""


@pytest.mark.parametrize(
    ("system", "environ", "colours"),
    [
        ("truecolor", {"TERM": "xterm"}, "all"),
        ("256", {"TERM": "xterm-256color"}, "all"),
        ("standard", {"TERM": "xterm"}, "few"),
        ("standard", {"TERM": "linux"}, "few"),
        ("standard", {"TERM": "vt100"}, "none"),
        ("standard", {"TERM": "xterm-mono"}, "none"),
        ("standard", {"TERM": "nobody-heard-of-it"}, "few"),
        ("truecolor", {"TERM": "xterm", "NO_COLOR": "1"}, "none"),
    ],
)
def test_colours_are_those_of_the_terminal(system, environ, colours):
    assert terminal_limits(system, environ | {"SCENARIO_GLYPHS": "unicode"}) == TerminalLimits(
        colours
    )


@pytest.mark.parametrize(
    ("environ", "encoding", "expected"),
    [
        ({"TERM": "xterm"}, "utf-8", False),
        ({"TERM": "xterm"}, "UTF8", False),
        ({"TERM": "xterm"}, "iso-8859-1", True),
        ({"TERM": "xterm"}, None, True),
        ({"TERM": "linux"}, "utf-8", True),
        ({"TERM": "linux", "SCENARIO_GLYPHS": "unicode"}, "utf-8", False),
        ({"TERM": "xterm", "SCENARIO_GLYPHS": "ascii"}, "utf-8", True),
        ({"TERM": "xterm", "SCENARIO_GLYPHS": "unicode"}, "iso-8859-1", False),
    ],
)
def test_signs_follow_the_encoding_of_the_stream(monkeypatch, environ, encoding, expected):
    streams = SimpleNamespace(stderr=SimpleNamespace(encoding=encoding))
    monkeypatch.setattr(capabilities, "sys", streams)
    assert ascii_only(environ) is expected


@pytest.mark.parametrize(
    ("told", "light"),
    [("0;15", True), ("15;0", False), ("0;default;15", True), ("15;8", False), ("", False)],
)
def test_the_environment_says_whether_the_background_is_light(told, light):
    assert light_background({"COLORFGBG": told}) is light


def test_every_verdict_keeps_a_colour_of_its_own_hue():
    names = {
        word: reduce_style(dashboard_theme().styles[word], colours=True).color for word in GLYPHS
    }
    shown = {word: colour.name if colour else "" for word, colour in names.items()}
    assert shown["pass"] == "green"
    assert shown["fail"] == "red"
    assert shown["inconclusive"] == "yellow"
    assert shown["lost"] == shown["error"] == "magenta"
    assert shown["queued"] == shown["cancelled"] == ""
    assert "blue" not in shown.values()  # nobody can read it on black


def test_what_is_selected_is_in_reverse_and_nothing_else_has_a_background():
    selected, panel = Style.parse("bold #ddedf9 on #0178d4"), Style.parse("#e0e0e0 on #242f38")
    assert reduce_style(selected, colours=True) == Style(bold=True, reverse=True)
    assert reduce_style(selected, colours=False) == Style(bold=True, reverse=True)
    assert reduce_style(panel, colours=True) == Style()


def test_on_a_light_theme_only_what_is_dark_stands_out():
    light = Style.parse("#202020 on #e0e0e0")
    assert reduce_style(light, colours=True, dark=False) == Style()
    assert reduce_style(Style.parse("#ffffff on #004578"), colours=True, dark=False).reverse


def test_without_colours_only_attributes_are_left():
    segments = [Segment("✗ fail", Style.parse("bold #ff7b7b on #1e1e1e")), Segment("x")]
    (fail, rest) = ReducedColours(colours=False).apply(segments, BLACK)
    assert fail.style == Style(bold=True)
    assert rest.text == "x"


def test_signs_in_ascii_differ_where_words_differ():
    signs = {word: to_ascii(glyph) for word, glyph in GLYPHS.items()}
    assert all(sign.isascii() and len(sign) == 1 for sign in signs.values())
    assert len(set(signs.values())) == len(signs)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("✓ pass  −0.03 m", "+ pass  -0.03 m"),
        ("╭─┤⏎├─╮", "+-+&+-+"),
        ("    ▐│███▌ ", "    ||###| "),
        ("⠀⠁⠃⡇⣿", " ..:#"),
        ("→↗↑↖←↙↓↘", ">/^\\</v\\"),
        ("Flur Süd, 漢字", "Flur Sud, ????"),
    ],
)
def test_everything_is_said_in_ascii_as_wide_as_before(text, expected):
    assert to_ascii(text) == expected
    assert cell_len(expected) == cell_len(text)
    (segment,) = AsciiGlyphs().apply([Segment(text, Style(bold=True))], BLACK)
    assert segment == Segment(expected, Style(bold=True))
