"""Grammars as textX has read them once, so that nobody waits until it has read them again.

Beside a grammar ``NAME.tx`` lies ``NAME.tree.json``: what textX's own parser makes of it, which is
two thirds of the time it takes to load a language. It says of which grammar and by which versions
of textX and Arpeggio it was made; anything else is read by textX as ever. It is plain data, and
textX checks what it says as if it had just read it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

_WITH_GROUP: Final = "re_match"
"""The one rule of textX's language of whose match it wants a group: what is between the slashes."""


@contextmanager
def read_before(grammar: Path) -> Iterator[None]:
    """Have textX take the stored tree of a grammar for what it has read, if there is one for it.

    The caller sees to it that nobody else uses textX meanwhile.
    """
    from textx import lang

    text = grammar.read_text(encoding="utf-8")
    tree = _stored_tree(grammar, text)
    if tree is None:
        yield
        return
    # Where textX keeps its parser from one grammar to the next: that is how it gets ours.
    usual = lang.textX_parsers.get(False)
    lang.textX_parsers[False] = _StoredParser(text, tree)
    try:
        yield
    finally:
        if usual is None:
            del lang.textX_parsers[False]
        else:
            lang.textX_parsers[False] = usual


def tree_file(grammar: Path) -> Path:
    """Return where the tree of a grammar is stored."""
    return grammar.with_suffix(".tree.json")


def tree_text(grammar: Path) -> str:
    """Return what belongs into the :func:`tree_file` of a grammar, read by textX as installed."""
    from textx import lang

    text = grammar.read_text(encoding="utf-8")
    parser = lang.ParserPython(
        lang.textx_model, comment_def=lang.comment, ignore_case=False, reduce_tree=False
    )
    rules: dict[str, int] = {}
    tree = _plain(parser.parse(text), rules)
    body = {"made": _stamp(text), "rules": list(rules), "tree": tree}
    return json.dumps(body, separators=(",", ":"), ensure_ascii=False) + "\n"


def _stamp(text: str) -> dict[str, str]:
    import arpeggio
    import textx

    digest = hashlib.sha256(text.encode()).hexdigest()
    return {"grammar": digest, "textX": textx.__version__, "Arpeggio": arpeggio.__version__}


def _plain(node: Any, rules: dict[str, int]) -> list[Any]:
    """Return a node as its rule's number and what is in it: nodes, or a place and a text.

    Signs that mean nothing once they are read have a 1 behind them.
    """
    rule = rules.setdefault(node.rule_name, len(rules))
    if isinstance(node, list):
        return [rule, *(_plain(one, rules) for one in node)]
    return [rule, node.position, node.value, *([1] if node.suppress else [])]


def _stored_tree(grammar: Path, text: str) -> Any:
    try:
        stored = json.loads(tree_file(grammar).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    if stored["made"] != _stamp(text):
        return None
    return _node(stored["tree"], [SimpleNamespace(rule_name=name) for name in stored["rules"]])


def _node(plain: list[Any], rules: list[SimpleNamespace]) -> Any:
    from arpeggio import NonTerminal, Terminal

    def build(plain: list[Any]) -> Any:
        rule = rules[plain[0]]
        if type(plain[1]) is int:
            node = Terminal(rule, plain[1], plain[2], suppress=len(plain) > 3)
            if rule.rule_name == _WITH_GROUP:
                between = plain[2][1:-1]
                node.extra_info = SimpleNamespace(group=lambda number: between)
            return node
        # Its constructor looks for lists in lists, which are not here.
        made = NonTerminal.__new__(NonTerminal)
        made.extend(map(build, plain[1:]))
        made.rule, made.rule_name, made.position = rule, rule.rule_name, made[0].position
        made.error = made._filtered = False
        made.comments = None
        return made

    return build(plain)


class _StoredParser:
    """Stands for textX's parser of grammars: it has read one already."""

    debug = False

    def __init__(self, text: str, tree: Any) -> None:
        self._text = text
        self._tree = tree

    def parse(self, text: str, file_name: str | None = None) -> Any:
        """Return what was read."""
        return self._tree

    def pos_to_linecol(self, position: int) -> tuple[int, int]:
        """Return line and column of a place, both from 1."""
        before = self._text[:position]
        return before.count("\n") + 1, position - before.rfind("\n")
