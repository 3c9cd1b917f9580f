"""Pages of the documentation: links lead somewhere, blocks can be read, names exist."""

import json
import re
import shlex
import textwrap
import tomllib

import pytest
import yaml

import scenario_tui
from scenario_tui.cli.commands import COMMANDS, load_command
from tests.docs.markdown import DOCS, ROOT, blocks, broken, links, pages

PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md")))
_BLOCK = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`([^`\n]+)`")
_COMMAND = re.compile(r"(?:^\s*|[$>] ?|&& |run: |- )scenario ([a-z]+\b.*)")
_ROOMS = ("campaigns", "daemon", "docs", "grammars", "scenario_tui", "templates", "tests")


def _code():
    """Yield each page with the lines of its blocks and its other pieces of code."""
    for page in PAGES:
        text = page.read_text("utf-8")
        name = str(page.relative_to(ROOT))
        for block in _BLOCK.findall(text):
            for line in block.replace("\\\n", " ").splitlines():
                yield name, line
        for inline in _INLINE.findall(_BLOCK.sub("", text)):
            yield name, inline


CODE = tuple(_code())


def _typed():
    """Return the words behind ``scenario`` of every command in the pages."""
    for page, line in CODE:
        for found in _COMMAND.findall(line):
            words = re.split(r" (?:[#|>;]|&&|then\b)|\s{3,}", found.partition("  #")[0])[0]
            try:
                yield page, shlex.split(words)
            except ValueError:
                yield page, words.split()


def _command_of(words):
    command, rest = load_command(words[0]), words[1:]
    inner = getattr(command, "commands", None)
    if inner and rest and rest[0] in inner:
        return inner[rest[0]], rest[1:]
    return command, rest


def test_the_pages_name_commands_that_there_are():
    typed = list(_typed())
    assert len(typed) > 150, "the pages are not read as they are written"
    assert not [(page, words[0]) for page, words in typed if words[0] not in COMMANDS]


def test_the_options_of_commands_exist():
    wrong = []
    for page, words in _typed():
        if words[0] not in COMMANDS:
            continue
        command, rest = _command_of(words)
        known = {"--help", "-h"}
        for parameter in command.params:
            known |= {*parameter.opts, *parameter.secondary_opts}
        for word in rest:
            if word == "--":
                break
            option = re.match(r"--[a-z][a-z0-9-]*|-[a-zA-Z]$", word)
            if option and option[0] not in known:
                wrong.append((page, " ".join(words), option[0]))
    assert not wrong


def test_files_that_pages_name_ship():
    missing = set()
    for page, line in CODE:
        for word in re.findall(r"[\w./-]+", line):
            first, slash, rest = word.partition("/")
            # Placeholders are written in capitals.
            if not slash or first not in _ROOMS or not rest or re.search(r"\b[A-Z]{3,}\b", rest):
                continue
            if not (ROOT / word.rstrip("./")).exists():
                missing.add((page, word))
    assert not missing


def _yaml(text):
    return list(yaml.safe_load_all(text))


def _python(text):
    return compile(text, "a page", "exec")


_READERS = {"yaml": _yaml, "toml": tomllib.loads, "json": json.loads, "python": _python}


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_blocks_can_be_read(page):
    assert [said for block in blocks(page) if (said := _unread(block))] == []


def _unread(block):
    reader = _READERS.get(block.words[0]) if block.words else None
    if reader is None:
        return ""
    try:
        reader(textwrap.dedent(block.text))
    except Exception as error:
        return f"{block}: {error}"
    return ""


def test_every_link_leads_to_a_file_and_a_heading():
    found = [broken(link) for page in pages() for link in links(page)]
    assert [problem for problem in found if problem] == []


def test_the_start_page_leads_to_every_page():
    start = DOCS / "index.md"
    reached = {(DOCS / link.target.partition("#")[0]).resolve() for link in links(start)}
    assert set(DOCS.rglob("*.md")) - reached - {start} == set()


def test_the_page_about_python_has_every_public_name():
    page = (DOCS / "library.md").read_text("utf-8")
    assert [name for name in scenario_tui.__all__ if not re.search(rf"[`.]{name}\b", page)] == []
