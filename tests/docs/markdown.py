"""Pages of the documentation as text: headings and their anchors, links, blocks of code."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
LANGUAGES = DOCS / "languages"
TUTORIALS = DOCS / "tutorials"
STUDIES = ROOT / "campaigns" / "studies"

_FENCE = re.compile(r"^(?P<indent> *)(?P<fence>`{3,})(?P<info>[^\n`]*)$")
_HEADING = re.compile(r"^#{1,6} +(?P<title>.*?)\s*#*$")
_LINK = re.compile(r"(?<!\\)\]\((?P<target>[^()\s]*(?:\([^()]*\)[^()\s]*)*)\)")
_CODE = re.compile(r"(`+)(?:(?!\1).)*\1")
_ID = re.compile(r'<a (?:id|name)="(?P<id>[^"]+)">')


@dataclass(frozen=True, slots=True)
class Block:
    """A block of code: the words after its fence, its text, the line of its first line."""

    page: Path
    line: int
    words: tuple[str, ...]
    text: str

    def __str__(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}"


@dataclass(frozen=True, slots=True)
class Link:
    """A link of a page: the line it stands in, and what it leads to as written."""

    page: Path
    line: int
    target: str

    def __str__(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}: {self.target}"


def pages():
    """Return every Markdown file people read, those of the root first."""
    return (*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md")), *sorted(STUDIES.glob("*.md")))


def blocks(page):
    """Return the blocks of code of a page, in order."""
    return tuple(part for part in _parts(page) if isinstance(part, Block))


def _parts(page):
    """Yield the blocks of a page, and the numbered lines that are no code."""
    start, fence, indent, words, body = 0, "", "", (), []
    for number, line in enumerate(page.read_text("utf-8").splitlines(), start=1):
        opening = _FENCE.match(line)
        if fence and line.strip() == fence:
            yield Block(page, start, words, "".join(body))
            fence = ""
        elif fence:
            body.append(f"{line.removeprefix(indent)}\n")
        elif opening:
            start, fence, indent = number + 1, opening["fence"], opening["indent"]
            words, body = tuple(opening["info"].split()), []
        else:
            yield number, line


def _prose(page):
    return (part for part in _parts(page) if not isinstance(part, Block))


def anchors(page):
    """Return what a link to a place in a page may name: its headings as GitHub spells them."""
    seen = {}
    found = set()
    for _, line in _prose(page):
        found |= {match["id"] for match in _ID.finditer(line)}
        heading = _HEADING.match(line)
        if heading is None:
            continue
        title = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading["title"]).replace("`", "")
        # What is neither a word character, a blank nor a hyphen is dropped; blanks are hyphens.
        slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        count = seen.get(slug, 0)
        seen[slug] = count + 1
        found.add(f"{slug}-{count}" if count else slug)
    return frozenset(found)


def links(page):
    """Yield the links and pictures of a page."""
    for number, line in _prose(page):
        for match in _LINK.finditer(_CODE.sub("``", line)):
            yield Link(page, number, match["target"])


def broken(link):
    """Return what is wrong with a link within the project, nothing if it is in order."""
    target, _, anchor = link.target.partition("#")
    if re.match(r"[a-z]+:", link.target):
        return ""
    path = (link.page.parent / target).resolve() if target else link.page
    if not path.exists():
        return f"{link}: no such file"
    if anchor and path.suffix == ".md" and anchor not in anchors(path):
        return f"{link}: no such heading; there are {', '.join(sorted(anchors(path)))}"
    return ""
