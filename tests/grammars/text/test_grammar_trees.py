"""The stored trees of our grammars are what textX reads, and are left alone where they are not."""

import shutil
from pathlib import Path

import pytest
from textx import lang, metamodel_from_file

import grammars
from grammars.text.grammar_trees import tree_file, tree_text
from grammars.text.parsing import load_metamodel

GRAMMARS = sorted(Path(grammars.__file__).parent.rglob("*.tx"))


@pytest.mark.parametrize("grammar", GRAMMARS, ids=lambda grammar: grammar.stem)
def test_the_stored_tree_of_a_grammar_is_what_textx_reads(grammar):
    remedy = "write it anew: python -m tests.language_docs"
    assert tree_file(grammar).read_text("utf-8") == tree_text(grammar), remedy


@pytest.fixture
def readings(monkeypatch):
    """The grammars that textX reads itself."""
    read = []
    usual = lang.ParserPython

    class Parser(usual):
        def parse(self, text, *more):
            read.append(text)
            return super().parse(text, *more)

    monkeypatch.setattr(lang, "ParserPython", Parser)
    monkeypatch.setattr(lang, "textX_parsers", {})
    return read


def _described(metamodel):
    """Return what a language is made of: the attributes of its nodes."""
    return {
        cls.__name__: [
            (one.name, one.cls.__name__, one.mult, one.cont, one.ref, one.bool_assignment)
            for one in cls._tx_attrs.values()
        ]
        for cls in metamodel
    }


def test_a_stored_tree_is_taken_for_the_grammar(readings):
    grammar = next(one for one in GRAMMARS if one.stem == "floorplan")
    stored = load_metamodel(grammar)
    assert readings == []
    # Nothing of it stays in textX, which goes on to read what others give it.
    read = metamodel_from_file(str(grammar))
    assert len(readings) == 1
    assert _described(stored) == _described(read)


def test_a_grammar_that_was_changed_is_read(readings, tmp_path):
    (copy,) = (Path(shutil.copy(one, tmp_path)) for one in GRAMMARS if one.stem == "oracle")
    original = next(one for one in GRAMMARS if one.stem == "oracle")
    shutil.copy(tree_file(original), tree_file(copy))
    load_metamodel(copy)
    assert readings == []
    copy.write_text(copy.read_text("utf-8") + "\n// changed\n", "utf-8")
    load_metamodel(copy)
    assert len(readings) == 1
