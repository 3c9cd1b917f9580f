"""The table of signals in ``docs/oracles.md``, made from the registry.

``python -m tests.oracle_docs`` writes it anew; a test holds the document to it.
"""

from __future__ import annotations

import re
from pathlib import Path

from grammars.oracle import OBJECT_SIGNALS, SIGNALS, SignalDeclaration

PAGE = Path(__file__).parents[1] / "docs" / "oracles.md"
_BETWEEN = re.compile(r"(<!-- signals: [^>]*-->\n).*?(<!-- end of signals -->)", re.DOTALL)


def signal_table() -> str:
    """Return a Markdown table of every signal that ships here."""
    rows = [_row(kind, kind.name) for kind in SIGNALS.values()]
    rows += [_row(kind, f"<object>.{kind.name}") for kind in OBJECT_SIGNALS.values()]
    return "\n".join(("| signal | unit | what it is |", "|---|---|---|", *rows)) + "\n"


def page_with_table() -> str:
    """Return the document as it should be."""
    return _BETWEEN.sub(lambda found: found[1] + signal_table() + found[2], PAGE.read_text())


def _row(kind: SignalDeclaration, name: str) -> str:
    parts = ["**object**"] if kind.takes_object else []
    parts += ["robot", f"**{' or '.join(kind.relates)}**"] if kind.relates else []
    parts += [f"**{dimension.unit}**" for dimension in kind.arguments]
    takes = f" [{', '.join(parts)}]" if parts else ""
    doc = kind.doc.replace("|x|", "abs(x)").replace("|y|", "abs(y)")
    return f"| `{name}`{takes} | {kind.unit} | {doc} |"


if __name__ == "__main__":
    PAGE.write_text(page_with_table())
