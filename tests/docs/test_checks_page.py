"""The page of checks has every message of the pre-flight, and none besides."""

import re
from pathlib import Path

from tests.docs.messages import message_templates

ROOT = Path(__file__).parents[2]
SOURCES = (
    *sorted((ROOT / "grammars" / "preflight").glob("_*.py")),
    ROOT / "daemon" / "campaign" / "_findings.py",
    ROOT / "daemon" / "search" / "preparation.py",
)
# Some of their messages are on the page, besides those of what cannot be read at all.
SHARED = (
    ROOT / "grammars" / "scenery" / "_parameters.py",
    ROOT / "grammars" / "scenery" / "composition" / "_placement.py",
)
_ROW = re.compile(r"^\| `(.+?)` \|", re.MULTILINE)
_PLACEHOLDER = re.compile(r"\b[A-Z]+\b|\bN\b")


def test_the_page_of_checks_has_every_message():
    rows = _ROW.findall((ROOT / "docs" / "checks.md").read_text("utf-8"))
    told = {re.sub("…+", "…", _PLACEHOLDER.sub("…", row)) for row in rows}
    given, shared = (
        {template for file in files for template in message_templates(file)}
        for files in (SOURCES, SHARED)
    )
    assert told - given - shared == set()
    assert given - told == set()
