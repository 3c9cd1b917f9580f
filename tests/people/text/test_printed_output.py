"""What other programs printed: bounded, in whole lines, harmless to a terminal."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenario_tui.text.formatting import last_lines, printed_lines

LOST = "\N{REPLACEMENT CHARACTER}"


@pytest.mark.parametrize(
    ("printed", "lines"),
    [
        ("", []),
        ("one\ntwo\n", ["one", "two"]),
        ("one\r\ntwo\r\n\r\n", ["one", "two"]),
        ("10 %\r50 %\rdone\nnext", ["done", "next"]),
        ("\x1b[1;31mred\x1b[0m \x1b[2Jgone", ["red gone"]),
        ("\x1b]0;a title\x07text \x1b]8;;http://x\x1b\\link", ["text link"]),
        ("\x1bcreset \x1b(Bset", ["reset Bset"]),
        ("bell\x07 back\x08", [f"bell{LOST} back{LOST}"]),
        ("turned \N{RIGHT-TO-LEFT OVERRIDE}round", [f"turned {LOST}round"]),
        ("a\tb", ["a       b"]),
    ],
)
def test_lines_are_as_a_terminal_would_have_left_them(printed, lines):
    assert printed_lines(printed) == lines


@given(st.text(alphabet=st.characters(), max_size=200))
def test_no_sign_is_left_that_a_terminal_obeys(text):
    left = {sign for line in printed_lines(text) for sign in line}
    assert not {unicodedata.category(sign) for sign in left} & {"Cc", "Cs", "Zl", "Zp"}
    turning = ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
    assert not {unicodedata.bidirectional(sign) for sign in left} & set(turning)


def test_the_last_lines_and_how_many_there_are_before():
    text = "\n".join(str(i) for i in range(50))
    assert last_lines(text) == ([str(i) for i in range(10, 50)], 10)
    assert last_lines(text, 2) == (["48", "49"], 48)
    assert last_lines(text, None)[1] == 0
    assert last_lines("") == ([], 0)
