"""Texts of drawings as PNG and PDF: every letter is there, whatever fonts the machine has."""

import pytest

from templates.picture import Drawing, write_drawing
from templates.picture._drawing import Colour, TextLabel

SAID = "−–—×·→←°±²³…∞≤≥µσΩ“”’½äöüßéñçøåłşПж✓✗▶"
"""What we say ourselves (minus, dashes, arrows, units), and letters of names in Europe."""


def painted(text, path, *, bold=False):
    drawing = Drawing(60.0, 40.0, "letters", "")
    drawing.add("words", [TextLabel((30.0, 25.0), text, 20.0, Colour.INK, bold=bold)])
    return write_drawing(drawing, path).read_bytes()


@pytest.mark.parametrize("bold", [False, True])
def test_no_letter_comes_out_as_a_box(tmp_path, bold):
    box = painted("\ue000", tmp_path / "box.png", bold=bold)
    blank = painted(" ", tmp_path / "blank.png", bold=bold)
    for letter in SAID:
        shown = painted(letter, tmp_path / "letter.png", bold=bold)
        assert shown not in (box, blank), letter


def test_bold_texts_are_bold(tmp_path):
    plain, bold = (painted("door", tmp_path / "a.png", bold=bold) for bold in (False, True))
    assert plain != bold


def test_a_pdf_has_our_face(tmp_path):
    document = painted("door", tmp_path / "a.pdf")
    assert document.startswith(b"%PDF-")
    assert b"ScenarioSans" in document
