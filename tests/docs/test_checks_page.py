"""The page of checks has every message of the pre-flight, and none besides."""

import ast
import re

from tests.docs.markdown import DOCS, ROOT

SOURCES = (
    *sorted((ROOT / "grammars" / "preflight").glob("_*.py")),
    ROOT / "daemon" / "campaign" / "_findings.py",
    ROOT / "grammars" / "oracle" / "_bounds.py",
    ROOT / "grammars" / "oracle" / "_spots.py",
    ROOT / "daemon" / "search" / "preparation.py",
)
# Some of their messages are on the page, besides those of what cannot be read at all.
SHARED = (
    ROOT / "grammars" / "scenery" / "_parameters.py",
    ROOT / "grammars" / "scenery" / "composition" / "_placement.py",
    ROOT / "daemon" / "stacks" / "ros1" / "advice.py",
    ROOT / "daemon" / "stacks" / "ros1" / "wiring.py",
    ROOT / "daemon" / "stacks" / "ros1" / "costmap" / "reading.py",
)
_ROW = re.compile(r"^\| `(.+?)` \|", re.MULTILINE)
_PLACEHOLDER = re.compile(r"\b[A-Z]+\b|\bN\b")


def test_the_page_of_checks_has_every_message():
    rows = _ROW.findall((DOCS / "checks.md").read_text("utf-8"))
    told = {re.sub("…+", "…", _PLACEHOLDER.sub("…", row)) for row in rows}
    given, shared = (
        {template for file in files for template in message_templates(file)}
        for files in (SOURCES, SHARED)
    )
    assert told - given - shared == set()
    assert given - told == set()


_CALLS = frozenset({"Finding", "_warning", "error", "warn", "warning"})
_GAP = "…"


def message_templates(path):
    """Return the texts of a module's findings, with ``…`` for what is only known later."""
    tree = ast.parse(path.read_text("utf-8"))
    found = {text for node in _messages(tree) for text in _texts(node)}
    # What is nothing but names and punctuation is put together of parts found elsewhere.
    return {text for text in found if len(text.replace(_GAP, "").split()) > 1}


def _messages(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = (
                node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
            )
            if name in _CALLS and len(node.args) > 1:
                yield node.args[1]
        elif isinstance(node, ast.Assign) and any(map(_is_message, node.targets)):
            yield node.value


def _is_message(target):
    return isinstance(target, ast.Name) and target.id == "message"


def _texts(node):
    match node:
        case ast.Constant(value=str(text)):
            yield text
        case ast.JoinedStr(values=values):
            parts = [str(part.value) if isinstance(part, ast.Constant) else _GAP for part in values]
            yield "".join(parts).replace(_GAP + _GAP, _GAP)
        case ast.IfExp(body=body, orelse=other):
            yield from _texts(body)
            yield from _texts(other)
        case _:
            return
