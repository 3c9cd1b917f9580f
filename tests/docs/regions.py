"""The parts of pages that are made: grammars, tables of keys, the table of signals.

Each stands between two comments, of which the first says what it is::

    <!-- grammar: scenery Link Shape -->       these rules; without names all of the language
    <!-- keys: robot drive -->                 this part of a schema
    <!-- keys: sut sut about like -->          these keys of it
    <!-- signals -->                           the signals of the oracle language
    <!-- columns -->                           the columns of a table of results
    <!-- end -->

``python -m tests.docs`` writes them anew; a test holds the pages to it.
"""

import re

from daemon.analysis.table import COLUMNS
from grammars.oracle import OBJECT_SIGNALS, SIGNALS
from tests.docs import ebnf, tables
from tests.docs.markdown import DOCS

_REGION = re.compile(
    r"^(?P<begin><!-- (?P<what>grammar|keys|signals|columns)(?::(?P<words>[^>]*))? -->\n)"
    r".*?^(?P<end><!-- end -->)$",
    re.DOTALL | re.MULTILINE,
)


def made_pages():
    """Yield every page with parts that are made, and its text as it should be."""
    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text("utf-8")
        made = _REGION.sub(lambda found: f"{found['begin']}\n{_made(found)}\n{found['end']}", text)
        if _REGION.search(text):
            yield page, made


def shown(what):
    """Return what regions of a kind name, in all pages: ``scenery Link``, ``robot drive``."""
    found = set()
    for page in DOCS.rglob("*.md"):
        for match in _REGION.finditer(page.read_text("utf-8")):
            if match["what"] == what:
                first, *rest = (match["words"] or "").split()
                if what == "grammar":
                    rest = rest or ebnf.rules(first)
                found |= {f"{first} {one}" for one in rest}
    return frozenset(found)


def _made(found):
    words = (found["words"] or "").split()
    if found["what"] == "signals":
        return _signal_table()
    if found["what"] == "columns":
        return _column_table()
    if found["what"] == "keys":
        return tables.key_table(*words)
    language, *names = words
    rules = ebnf.rules(language)
    # Classes of syntax nodes end so; to readers a rule is what it stands for.
    text = "\n".join(rules[name] for name in names or rules)
    return f"```ebnf\n{text}\n```\n"


def _column_table():
    rows = [f"| `{one.name}` | {one.kind} | {one.unit} | {one.about} |" for one in COLUMNS]
    return "\n".join(("| column | kind | unit | |", "|---|---|---|---|", *rows)) + "\n"


def _signal_table():
    """Return a Markdown table of every signal that ships here."""
    rows = [_signal_row(kind, kind.name) for kind in SIGNALS.values()]
    rows += [_signal_row(kind, f"<object>.{kind.name}") for kind in OBJECT_SIGNALS.values()]
    return "\n".join(("| signal | unit | what it is |", "|---|---|---|", *rows)) + "\n"


def _signal_row(kind, name):
    parts = ["**object**"] if kind.takes_object else []
    parts += ["robot", f"**{' or '.join(kind.relates)}**"] if kind.relates else []
    parts += ["**node**"] if kind.takes_node else []
    parts += [f"**{dimension.unit}**" for dimension in kind.arguments]
    takes = f" [{', '.join(parts)}]" if parts else ""
    doc = kind.doc.replace("|x|", "abs(x)").replace("|y|", "abs(y)")
    return f"| `{name}`{takes} | {kind.unit} | {doc} |"
