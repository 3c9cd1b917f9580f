"""What may stand on a terminal, and what stands there for the rest."""

import io
import json
import sys
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.text.terminal_text import (
    PrintableStream,
    escape_json,
    printable,
    printable_streams,
    spell_out,
    unfiltered,
    without_escapes,
)

LOST = "\N{REPLACEMENT CHARACTER}"
TURNING = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}


def steers(sign):
    """Whether Unicode's tables say that a terminal may do more with it than show it."""
    turns = unicodedata.bidirectional(sign) in TURNING or sign in "\u200e\u200f\u061c"
    control = unicodedata.category(sign) in ("Cc", "Cs", "Zl", "Zp") and sign not in "\n\t"
    return turns or control or sign == "\ufeff" or 0xE0000 <= ord(sign) <= 0xE007F


def test_every_sign_that_steers_is_replaced_and_no_other_letter():
    for code in (*range(0x20000), *range(0xE0000, 0xE1000)):
        sign = chr(code)
        shown = printable(sign)
        if steers(sign):
            assert shown == LOST, hex(code)
        elif unicodedata.category(sign) not in ("Cf", "Cn"):
            assert shown == sign, hex(code)


@pytest.mark.parametrize(
    "text",
    [
        "plain, ümläut, 日本語, עברית, \u00a0 and \u202f",
        "one\n\ttwo\r\nthree",
        "👩\u200d👩\u200d👧 ❤\ufe0f می\u200cخواهم",
    ],
)
def test_what_people_write_stays(text):
    assert printable(text) == spell_out(text) == text


def test_what_is_left_of_sequences_is_text():
    assert printable("\x1b]0;title\x07\x9b2J") == f"{LOST}]0;title{LOST}{LOST}2J"
    assert printable("written\rover\r\n") == f"written{LOST}over\r\n"
    assert spell_out("\x1b[31m \x9b \u202e \ud800") == r"\x1b[31m \x9b \u202e \ud800"
    assert without_escapes("\x1b[1mbold\x9b0m \x1b]0;title\x07text \x1bPq\x1b\\") == "bold text "


@given(st.text(st.characters(exclude_categories=()), max_size=100))
def test_nothing_gets_longer_and_json_stays_the_same(text):
    assert len(printable(text)) == len(text)
    for plain in (True, False):
        document = escape_json(json.dumps({text: [text]}, ensure_ascii=not plain, indent=1))
        assert json.loads(document) == {text: [text]}
        assert not any(map(steers, document.replace("\r", "")))


def test_a_stream_lets_through_what_is_printable():
    behind = io.StringIO()
    stream = PrintableStream(behind)
    assert stream.write("a\x1bb") == 3
    stream.writelines(["\u202e", "c\n"])
    print("\x9bd", file=stream)
    assert behind.getvalue() == f"a{LOST}b{LOST}c\n{LOST}d\n"
    assert unfiltered(stream) is behind
    assert unfiltered(behind) is behind
    assert stream.getvalue() == behind.getvalue()


def test_streams_of_the_process_are_filtered_once(capsys):
    before = sys.stdout, sys.stderr
    with printable_streams(), printable_streams():
        print("out\x1b")
        print("err\x07", file=sys.stderr)
        assert unfiltered(sys.stdout) is before[0]
    assert (sys.stdout, sys.stderr) == before
    assert capsys.readouterr() == (f"out{LOST}\n", f"err{LOST}\n")
