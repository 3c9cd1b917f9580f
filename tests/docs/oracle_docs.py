"""The table of signals in ``docs/languages/oracles.md``, made from the registry."""

from grammars.oracle import OBJECT_SIGNALS, SIGNALS


def signal_table():
    """Return a Markdown table of every signal that ships here."""
    rows = [_row(kind, kind.name) for kind in SIGNALS.values()]
    rows += [_row(kind, f"<object>.{kind.name}") for kind in OBJECT_SIGNALS.values()]
    return "\n".join(("| signal | unit | what it is |", "|---|---|---|", *rows)) + "\n"


def _row(kind, name):
    parts = ["**object**"] if kind.takes_object else []
    parts += ["robot", f"**{' or '.join(kind.relates)}**"] if kind.relates else []
    parts += ["**node**"] if kind.takes_node else []
    parts += [f"**{dimension.unit}**" for dimension in kind.arguments]
    takes = f" [{', '.join(parts)}]" if parts else ""
    doc = kind.doc.replace("|x|", "abs(x)").replace("|y|", "abs(y)")
    return f"| `{name}`{takes} | {kind.unit} | {doc} |"
