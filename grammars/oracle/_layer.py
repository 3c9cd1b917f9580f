"""Oracle layers: YAML files of ``name: oracle`` lines."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from grammars.diagnostics import Diagnostic, InputError, Where
from grammars.documents import Document, load_yaml
from grammars.oracle._model import Oracle
from grammars.oracle._parse import parse_oracle

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def load_oracles(path: str | Path) -> dict[str, Oracle]:
    """Read an oracle layer; oracles by name, in file order.

    Raises :class:`InputError` with every problem of the file.
    """
    document = load_yaml(path)
    if not isinstance(document.data, dict) or not document.data:
        raise InputError(
            Diagnostic(
                Where(document.file, 1),
                "expected lines of name: oracle",
                "such as: localised: always(loc.error <= 0.35 m)",
            )
        )
    oracles: dict[str, Oracle] = {}
    found: list[Diagnostic] = []
    for name, text in document.data.items():
        try:
            oracles[name] = _read(document, name, text)
        except InputError as error:
            found.extend(error.diagnostics)
    if found:
        raise InputError(found)
    return oracles


def _read(document: Document, name: str, text: object) -> Oracle:
    key = document.where((name,))
    if not _NAME.fullmatch(name):
        raise InputError(
            Diagnostic(key, f'"{name}" cannot name an oracle', "use letters, digits, - _ and .")
        )
    if not isinstance(text, str):
        raise InputError(Diagnostic(key, f'oracle "{name}" is not a line of text'))
    return parse_oracle(name, text, _value_place(document, key, text))


def _value_place(document: Document, key: Where, text: str) -> Where:
    """Return where ``text`` begins: after its key, when it stands on the same line."""
    lines = document.text.splitlines()
    line = lines[key.line - 1] if 0 < key.line <= len(lines) else ""
    column = line.find(text, key.column)
    return Where(key.file, key.line, column + 1) if column >= 0 else key
