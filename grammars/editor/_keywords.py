"""The words a textX grammar spells out, for whatever has to follow the grammar."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Final

_TOKEN: Final = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | '(?P<literal>(?:\\.|[^'\\])*)'
      | /(?P<regex>(?:\\.|[^/\\\n])+)/
      | (?P<rule>^\w+)(?=\s*:)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)


@cache
def literals(package: str, grammar: str) -> Mapping[str, tuple[str, ...]]:
    """Return by rule the quoted words and signs of a textX grammar file, in file order.

    ``package`` holds the file ``grammar``: ``literals("grammars.oracle", "oracle.tx")``.
    """
    text = (files(package) / grammar).read_text(encoding="utf-8")
    found: dict[str, list[str]] = {}
    rule = ""
    for match in _TOKEN.finditer(text):
        if match["rule"]:
            rule = match["rule"]
        elif match["literal"] is not None:
            found.setdefault(rule, []).append(match["literal"])
    return MappingProxyType({rule: tuple(words) for rule, words in found.items()})
