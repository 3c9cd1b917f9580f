"""Poor terminals: few colours, none, ASCII only; what is found out and what is made of it."""

import os
import pty
import select
import termios
import threading
from types import SimpleNamespace

import pytest
from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual.color import Color

from scenario_tui.terminal import capabilities
from scenario_tui.terminal.answer_parser import AnswerParser, BackgroundTold
from scenario_tui.terminal.background_question import BackgroundQuestion
from scenario_tui.terminal.capabilities import (
    TerminalLimits,
    ascii_only,
    terminal_limits,
    terminal_takes_utf8,
    why_undrawable,
)
from scenario_tui.terminal.filters import AsciiGlyphs, ReducedColours, reduce_style, to_ascii
from scenario_tui.text.formatting import DASHBOARD_STYLES, GLYPHS

BLACK = Color.parse("#121212")


@pytest.fixture
def terminal():
    """The two ends of a terminal: what shows it, and what a program in it reads and writes."""
    outside, inside = pty.openpty()
    yield outside, inside
    os.close(outside)
    os.close(inside)


@pytest.mark.parametrize("name", ["dumb", "unknown", ""])
def test_a_dumb_terminal_is_refused_with_what_to_do(name):
    said = why_undrawable({"TERM": name})
    assert "cannot be drawn on" in said
    assert "scenario status" in said


@pytest.mark.parametrize("name", ["xterm", "linux", "screen", "vt100", "tmux-256color"])
def test_others_are_drawn_on(name):
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
    ("environ", "utf8_mode", "answer", "expected"),
    [
        ({"LANG": "en_GB.UTF-8"}, 0, None, False),
        ({"LANG": "C"}, 1, True, False),
        ({"LANG": "C"}, 1, False, True),
        ({}, 1, True, False),
        ({"LANG": "en_GB.UTF-8"}, 1, None, False),  # not installed here, but meant
        ({"LANG": "de_DE.ISO-8859-1"}, 1, None, True),
        ({"LC_ALL": "POSIX", "LANG": "en_GB.UTF-8"}, 1, False, True),
        ({"LANG": "en_GB.UTF-8", "SCENARIO_GLYPHS": "ascii"}, 0, None, True),
        ({"LANG": "C", "SCENARIO_GLYPHS": "unicode"}, 1, None, False),
    ],
)
def test_signs_follow_the_locale_and_where_it_is_silent_the_terminal(
    monkeypatch, environ, utf8_mode, answer, expected
):
    def ask():
        assert answer is not None, "there was no need to ask"
        return answer

    streams = SimpleNamespace(
        flags=SimpleNamespace(utf8_mode=utf8_mode), stderr=SimpleNamespace(encoding="utf-8")
    )
    monkeypatch.setattr(capabilities, "sys", streams)
    assert ascii_only(environ, ask) is expected


@pytest.mark.parametrize(("column", "knows"), [(2, True), (4, False), (None, False)])
def test_a_terminal_is_asked_how_far_a_sign_moved_it(monkeypatch, column, knows):
    monkeypatch.setattr(capabilities, "_PATIENCE", 0.1 if column is None else 60.0)
    master, slave = pty.openpty()

    def answer():
        asked = b""
        while b"\x1b[6n" not in asked:
            asked += os.read(master, 64)
        if column is not None:
            os.write(master, f"\x1b[5;{column}R".encode())

    terminal = threading.Thread(target=answer)
    terminal.start()
    try:
        assert terminal_takes_utf8(slave, slave) is knows
    finally:
        terminal.join()
        os.close(master)
        os.close(slave)


def test_every_verdict_keeps_a_colour_of_its_own_hue():
    names = {
        word: reduce_style(Style.parse(style), colours=True).color
        for word, style in DASHBOARD_STYLES.items()
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


def keys_and_backgrounds(pieces):
    parser = AnswerParser()
    found = [message for piece in pieces for message in parser.feed(piece)]
    return [m.light if isinstance(m, BackgroundTold) else m.key for m in found]


@pytest.mark.parametrize("end", ["\x07", "\x1b\\"])
@pytest.mark.parametrize("cut", [2, 3, 5, 9, 23, 24])
def test_a_late_answer_is_no_key_in_however_many_pieces(cut, end):
    answer = f"\x1b]11;rgb:ffff/ffff/ffff{end}"
    assert keys_and_backgrounds([f"a{answer}b"]) == [True, "a", "b"]
    assert keys_and_backgrounds([answer[:cut], answer[cut:] + "b"]) == [True, "b"]
    assert keys_and_backgrounds([answer.replace("ffff", "0000")]) == [False]


def test_keys_that_begin_like_an_answer_are_keys():
    assert keys_and_backgrounds(["\x1b[A", "]11;"]) == ["up", "right_square_bracket", "1", "1",
                                                        "semicolon"]  # fmt: skip


@pytest.mark.parametrize(
    ("answer", "light"),
    [
        (b"\x1b]11;rgb:fdfd/f6f6/e3e3\x1b\\", True),
        (b"\x1b]11;rgb:ff/ff/ff\x07", True),
        (b"\x1b]11;rgba:00/2b/36/ff\x07", False),
        (b"\x1b[1;1R", False),
    ],
)
def test_a_terminal_tells_whether_its_background_is_light(terminal, answer, light):
    outside, inside = terminal
    asked = BackgroundQuestion({}, inside, inside)
    os.write(outside, answer)
    assert select.select([inside], [], [], 60.0)[0]
    assert asked.close() is light
    assert asked.close() is light, "the second time it is remembered"


@pytest.mark.parametrize(
    ("told", "light"), [("0;15", True), ("15;0", False), ("0;default;15", True), ("15;8", False)]
)
def test_where_the_background_is_told_nothing_is_asked(terminal, told, light):
    outside, inside = terminal
    assert BackgroundQuestion({"COLORFGBG": told}, inside, inside).close() is light
    assert not select.select([outside], [], [], 0.0)[0]


def test_nobody_waits_for_what_was_asked_early(terminal):
    outside, inside = terminal
    before = termios.tcgetattr(inside)
    silent = BackgroundQuestion({"COLORFGBG": "default"}, inside, inside)
    assert os.read(outside, 64) == b"\x1b]11;?\x1b\\"
    assert silent.close() is False
    asked = BackgroundQuestion({}, inside, inside)
    os.read(outside, 64)
    os.write(outside, b"\x1b]11;rgb:ff/ff/ff\x07")
    assert select.select([inside], [], [], 60.0)[0]
    asked.close()
    assert termios.tcgetattr(inside) == before
    assert not select.select([outside], [], [], 0.0)[0], "the answer was echoed"
