"""Thinned frames show the same screen as whole ones, in fewer bytes."""

import random

import pyte
import pytest
from rich.cells import cell_len

from scenario_tui.terminal.limited_terminal import TerminalDiff

COLUMNS, ROWS = 40, 10
FRAME = (
    "\x1b[1;1H\x1b[1;38;5;3mcampaigns\x1b[0m  done"
    "\x1b[2;1H\x1b[44mnightly    7 s ago\x1b[0m\x1b[1;1H"
)


class Pair:
    """Two terminals: one gets every frame, the other what a shadow leaves of it."""

    def __init__(self):
        self.shadow = TerminalDiff()
        self.screens = tuple(pyte.Screen(COLUMNS, ROWS) for _ in range(2))
        self._whole, self._thin = (pyte.Stream(screen) for screen in self.screens)

    def show(self, data):
        sent = self.shadow.reduce(data)
        self._whole.feed(data)
        self._thin.feed(sent)
        return sent

    def assert_same(self):
        whole, thin = (_shown(screen) for screen in self.screens)
        assert thin == whole


def _shown(screen):
    cells = [
        [(c.data, c.fg, c.bg, c.bold, c.reverse) for c in (screen.buffer[y][x] for x in range(40))]
        for y in range(ROWS)
    ]
    return cells, (screen.cursor.x, screen.cursor.y)


def test_only_the_cell_that_changed_is_sent():
    pair = Pair()
    pair.show(FRAME)
    sent = pair.show(FRAME.replace("7 s", "8 s"))
    assert sent == "\x1b[2;12H\x1b[44m8\x1b[m\x1b[1;1H"
    pair.assert_same()


@pytest.mark.parametrize("letters", ["ab ✓▶⠿─é", "ab 漢字 e\u0301"], ids=["narrow", "wide"])
def test_any_frames_show_the_same(letters):
    chance, pair = random.Random(20), Pair()
    for _ in range(300):
        pair.show(_some_frame(chance, letters))
        pair.assert_same()


def _some_frame(chance, letters):
    frame = []
    for _ in range(chance.randint(1, 6)):
        row, column = chance.randrange(ROWS), chance.randrange(30)
        frame.append(f"\x1b[{row + 1};{column + 1}H")
        for _ in range(chance.randint(1, 3)):
            text = "".join(chance.choice(letters) for _ in range(chance.randint(1, 5)))
            style = chance.choice(["", "1", "31;44", "38;5;3"])
            column += cell_len(text)
            if column <= COLUMNS:
                frame.append(f"\x1b[{style}m{text}\x1b[0m" if style else text)
    return "".join([*frame, f"\x1b[{ROWS};1H"])


def test_a_cleared_screen_is_drawn_whole():
    pair = Pair()
    first = pair.show(FRAME)
    assert pair.show("\x1b[?1049h") == "\x1b[?1049h"
    assert pair.show(FRAME) == first
    pair.shadow.forget()
    assert pair.show(FRAME) == first


def test_what_is_no_frame_goes_through():
    shadow = TerminalDiff()
    for data in ("\x1b[?25l", "\x07", "\x1b]52;c;aGk=\x07", "\x1b[?1006h"):
        assert shadow.reduce(data) == data


def test_a_frame_with_something_else_in_it_goes_through():
    pair = Pair()
    pair.show(FRAME)
    linked = FRAME.replace("done", "\x1b]8;;http://x\x1b\\done\x1b]8;;\x1b\\")
    assert pair.show(linked) == linked
    assert "nightly" in pair.show(FRAME)


def test_updates_are_announced_only_when_there_are_some():
    shadow = TerminalDiff()
    begin, end = "\x1b[?2026h", "\x1b[?2026l"
    sent = [shadow.reduce(data) for data in (begin, FRAME, end)]
    assert sent[0] == ""
    assert sent[1].startswith(begin)
    assert sent[2] == end
    assert [shadow.reduce(data) for data in (begin, FRAME, end)] == ["", "", ""]
