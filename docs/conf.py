"""Builds the documentation as a static site: ``make docs``.

Pages are plain Markdown that reads as well without a site. What a site needs beyond that is made
here: the navigation, from the lists of ``index.md``, and colours for the languages, from their
grammars. Nothing is fetched from a network, neither now nor by who reads.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, ClassVar

from pygments.lexer import RegexLexer, words
from pygments.token import Comment, Keyword, Name, Number, String, Text

_ROOT = Path(__file__).parents[1]

project = "scenario-tui"
extensions = ["myst_nb", "sphinx_copybutton"]
copybutton_prompt_text = "$ "  # what a terminal prints before a command is not copied
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
nb_execution_mode = "off"  # notebooks are shown with the outputs they have; the tests hold those
root_doc = "index"
myst_heading_anchors = 4
html_theme = "furo"
html_title = "scenario-tui"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
nitpicky = True


def setup(app: Any) -> None:
    """Register what is made here; Sphinx calls this."""
    app.connect("source-read", _as_page)
    for name, grammar in (("fpm", "floorplan"), ("scenery", "scenery"), ("variation", "variation")):
        app.add_lexer(name, _lexer(grammar))
    app.add_lexer("ebnf", _GrammarLexer)


def _as_page(app: Any, name: str, source: list[str]) -> None:
    """Turn the text of a file into that of a page of the site."""
    text = source[0]
    if name == root_doc:
        text = _with_navigation(text)
    source[0] = _without_links_to_sources(text, Path(app.srcdir), name)


def _with_navigation(text: str) -> str:
    """Add a hidden table of contents for each list of pages, under its heading."""
    parts = re.split(r"^(## .+)$", text, flags=re.MULTILINE)
    made = parts[0]
    for heading, body in zip(parts[1::2], parts[2::2], strict=True):
        pages = re.findall(r"^- \[[^\]]+\]\(([^)#]+)\.(?:md|ipynb)\)", body, re.MULTILINE)
        listed = "\n".join(pages)
        contents = f"```{{toctree}}\n:hidden:\n:caption: {heading[3:]}\n\n{listed}\n```\n"
        made += f"{heading}{body.rstrip()}\n\n{contents}\n"
    return made


def _without_links_to_sources(text: str, folder: Path, name: str) -> str:
    """Leave the words of links to files that are no part of the site, such as sources."""
    here = (folder / name).parent

    def plain(found: re.Match[str]) -> str:
        target = found["target"].partition("#")[0]
        inside = re.match(r"[a-z]+:", target) or (here / target).resolve().is_relative_to(folder)
        return found[0] if not target or inside else found["words"]

    return re.sub(r"(?<!!)\[(?P<words>[^\]]+)\]\((?P<target>[^)\s]+)\)", plain, text)


class _GrammarLexer(RegexLexer):
    """EBNF as it stands in these pages, with regular expressions; Pygments knows another one."""

    name = "ebnf"
    tokens: ClassVar = {
        "root": [
            (r"^\w+(?= =)", Keyword),
            (r"'[^']*'", String),
            (r"(?<=[ (])/(?:\\/|[^/\n])+/", String.Regex),
            (r"\? .* \?$", Comment),
            (r"\w+", Name),
            (r"\s+|.", Text),
        ]
    }


def _lexer(grammar: str) -> type[RegexLexer]:
    """Return what colours a language: the quoted words of its grammar are keywords."""
    text = (_ROOT / "grammars" / grammar / f"{grammar}.tx").read_text("utf-8")
    keywords = sorted(set(re.findall(r"'([A-Za-z]+)'", text)))
    tokens = {
        "root": [
            (r"//.*$", Comment.Single),
            (r'"[^"\n]*"', String),
            (words(keywords, prefix=r"\b", suffix=r"\b"), Keyword),
            (r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", Number),
            (r"\w+", Name),
            (r"\s+|.", Text),
        ]
    }
    return type(f"{grammar.title()}Lexer", (RegexLexer,), {"name": grammar, "tokens": tokens})
