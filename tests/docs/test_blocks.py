"""Blocks of code of every page are what they say they are: YAML, TOML, JSON, Python."""

import json
import textwrap
import tomllib

import pytest
import yaml

from tests.docs.markdown import ROOT, blocks, pages


def _yaml(text):
    return list(yaml.safe_load_all(text))


def _python(text):
    return compile(text, "a page", "exec")


_READERS = {
    "yaml": _yaml,
    "toml": tomllib.loads,
    "json": json.loads,
    "python": _python,
}


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
