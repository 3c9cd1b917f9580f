"""Specifications as the ledger keeps them: cells and scripts once, runs by their names.

The body of a specification or of a repeat in reserve is ``[cell, script, repeat, seed]``, where the
first two name rows of ``part`` by content; ledgers of schema 4 and before wrote every run out.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, TypeVar

from daemon.parcel import Script, Shelf
from daemon.spec import RunSpec
from grammars import codec

T = TypeVar("T")

_MOST_CACHED: Final = 1024
_NAME: Final = 32
"""Hexadecimal digits of SHA-256 that name a part."""


class Specs:
    """Reads bodies on one connection; the parts of those read lately are remembered."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._cells: dict[str, RunSpec] = {}
        self._scripts: dict[str, Script] = {}

    def read(self, body: bytes) -> RunSpec:
        """Return the specification that ``body`` stands for."""
        if not body.startswith(b"["):
            return codec.from_json(RunSpec, body)
        cell, script, repeat, seed = json.loads(body)
        same = self._part(cell, self._cells, lambda text: codec.from_json(RunSpec, text))
        drawn = self._part(script, self._scripts, _read_script)
        return replace(same, repeat=repeat, seed=seed, behaviours=drawn)

    def _part(self, name: str, cache: dict[str, T], read: Callable[[bytes], T]) -> T:
        if name not in cache:
            if len(cache) >= _MOST_CACHED:
                cache.clear()
            row = self._db.execute("SELECT body FROM part WHERE name = ?", (name,)).fetchone()
            cache[name] = read(row[0])
        return cache[name]


class SpecWriter:
    """Makes bodies of runs that are entered together."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db
        self._shelf = Shelf()
        self._cells: list[bytes] = []
        self._scripts: list[bytes] = []

    def body(self, run: RunSpec) -> bytes:
        """Enter what is new of a run, and return its body."""
        packed = self._shelf.pack(run)
        self._enter_new(self._cells, self._shelf.cells, RunSpec)
        self._enter_new(self._scripts, self._shelf.scripts, Script)
        names = (self._cells[packed.cell], self._scripts[packed.script])
        return b'["%s","%s",%d,%d]' % (*names, packed.repeat, packed.seed)

    def _enter_new(self, names: list[bytes], parts: list[Any], kind: Any) -> None:
        for part in parts[len(names) :]:
            text = codec.to_json(part, kind)
            name = hashlib.sha256(text).hexdigest()[:_NAME]
            self._db.execute("INSERT OR IGNORE INTO part VALUES (?, ?)", (name, text))
            names.append(name.encode())


def _read_script(text: bytes) -> Script:
    script: Script = codec.from_json(Script, text)
    return script
