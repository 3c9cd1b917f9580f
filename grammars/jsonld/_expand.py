"""From the text of a JSON-LD document to nodes, with everything unreadable reported in its place.

JSON is read strictly, and PyLD expands it. Keys and types that no context defines get IRIs of
their own (``UNKNOWN``), so that they are reported instead of vanishing.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value
from grammars.jsonld.vocabulary import (
    UNKNOWN,
    XSD,
    ContextError,
    context_for,
    context_of_type,
)
from grammars.text.diagnostics import Finding, InputError, Severity, SourceText, Where

# Documents come from outside: one with a million mistakes is refused after the first few, and
# contexts of strangers may refer to each other in a circle.
_MOST_FINDINGS: Final = 50
_MOST_CONTEXTS: Final = 64
_ID: Final = re.compile(r'"(?:@id|id)"\s*:\s*"([^"\\]*)"')
_NO_IRI: Final = re.compile(r'[\x00-\x20<>"{}|\\^`]')
_DOUBLE: Final = XSD["double"]
_NUMERIC: Final = frozenset(
    XSD[name] for name in ("double", "float", "decimal", "integer", "int", "long")
)


def expand_text(text: str, file: str, base: str = "") -> NodeGraph:
    """Return the nodes that the JSON-LD ``text`` describes.

    Relative identifiers resolve against the text's own ``@base``, else against ``base``, else
    against the address of ``file``. Raises :class:`InputError` with every problem.
    """
    source = _JsonSource(text, file)
    document = source.parsed()
    loose = [part for part in _parts(document) if not isinstance(part, dict)]
    if loose:
        message = f"expected nodes in braces, found {_short(loose[0])}"
        raise InputError.at(source.where(None), message)
    base = base or Path(file).absolute().as_uri()
    outdated: set[str] = set()
    process = _processor(base, outdated)
    try:
        _mark_nodes(document)
        reader = _NodeReader(source, process(document, ()))
        missing = reader.missing_contexts()
        if missing:
            # Once more, with the contexts that define those types in front of the document's own.
            reader = _NodeReader(source, process(document, sorted(missing)))
    except Exception as error:
        # PyLD answers some malformed documents with errors of Python, of whatever class.
        raise InputError(_problems(source, document, process, error)) from error
    return reader.finished(outdated, missing)


def _parts(document: Any) -> list[Any]:
    """Return the nodes on the highest level of a document."""
    inner = document.get("@graph", document) if isinstance(document, dict) else document
    return inner if isinstance(inner, list) else [inner]


_Process = Callable[[Any, Iterable[str]], list[Any]]


def _processor(base: str, outdated: set[str]) -> _Process:
    """Return PyLD's expansion with the contexts stored here; nothing is fetched.

    ``outdated`` collects former addresses of contexts.
    """
    # PyLD takes a while to import, and few layers are JSON-LD.
    from pyld import jsonld
    from pyld.context_resolver import ContextResolver

    def loaded(address: str, options: Any = None) -> dict[str, Any]:
        context = context_for(address, outdated)
        return {"document": {"@context": context}, "documentUrl": address, "contextUrl": None}

    def process(document: Any, contexts: Iterable[str]) -> list[Any]:
        options = {
            "base": base,
            "expandContext": [*contexts, {"@vocab": UNKNOWN}],
            "documentLoader": loaded,
            "contextResolver": ContextResolver({}, loaded, _MOST_CONTEXTS),
        }
        expanded: list[Any] = jsonld.expand(document, options)
        return expanded

    return process


def _mark_nodes(item: Any) -> None:
    """Give every node its identifier as written for an ``@index``, which expansion keeps."""
    if isinstance(item, list):
        for part in item:
            _mark_nodes(part)
    elif isinstance(item, dict):
        for key, part in item.items():
            if key != "@context":
                _mark_nodes(part)
        written = item.get("@id", item.get("id"))
        if isinstance(written, str):
            item["@index"] = written


def _problems(
    source: _JsonSource, document: Any, process: _Process, error: Exception
) -> Iterable[Finding]:
    """Return what PyLD refuses of each node by itself, else of the document as a whole."""
    whole = document if isinstance(document, dict) and "@graph" in document else {}
    found: list[Finding] = []
    # The contexts alone first: with a broken one there is nothing to say about nodes.
    for node in ({}, *_parts(document)):
        try:
            process({**whole, "@graph": [node]}, ())
        except Exception as fault:
            found.append(Finding(source.where(node.get("@id")), _explanation(fault)))
            if not node or len(found) == _MOST_FINDINGS:
                break
    return found or [Finding(source.where(None), _explanation(error))]


def _explanation(error: BaseException) -> str:
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, ContextError):
            return str(cause)
        cause = cause.__cause__
    if isinstance(error, RecursionError):
        return "is nested too deeply"
    text = str(error.args[0] if error.args else error).removeprefix("Invalid JSON-LD syntax; ")
    details = getattr(error, "details", None) or {}
    values = ", ".join(_short(value) for value in details.values())
    return f"is not JSON-LD: {text.rstrip('.')}" + (f": {values}" if values else "")


class _NodeReader:
    """Reads an expanded document into nodes."""

    def __init__(self, source: _JsonSource, expanded: list[Any]) -> None:
        self._source = source
        self._nodes = NodeGraph()
        self._blanks = 0
        self._written: dict[str, str] = {}
        self._unknown: dict[str, list[str]] = {}
        self._types: dict[str, str] = {}
        for node in expanded:
            self._node(node)

    def missing_contexts(self) -> dict[str, list[str]]:
        """Return the published contexts of types that no context of the document defines.

        By address the types, the first user of the first one in front.
        """
        found: dict[str, list[str]] = {}
        for name, user in self._types.items():
            address = context_of_type(name)
            if address:
                found.setdefault(address, [user]).append(name)
        return found

    def finished(self, outdated: Iterable[str], missing: dict[str, list[str]]) -> NodeGraph:
        """Return the nodes, with warnings; raises :class:`InputError` for errors."""
        if self._nodes.errors:
            raise InputError(self._nodes.errors[:_MOST_FINDINGS])
        self._nodes.is_earlier = bool(outdated)
        for address in sorted(outdated):
            self._warn("", f'"{address}" is an outdated address', "read as the current context")
        for address, (user, *names) in missing.items():
            message = f"no context defines {', '.join(names)}, first used by {_called(user)}"
            self._warn(user, message, f"read with {address}, which RDF tools need too")
        for key, users in self._unknown.items():
            more = f" (and in {len(users) - 1} other nodes)" if len(users) > 1 else ""
            self._warn(
                users[0],
                f'"{key}" of {_called(users[0])}{more} is in no context: ignored',
                "RDF tools drop it; add a context that defines it or remove it",
            )
        for iri, written in self._written.items():
            self._nodes.places[iri] = self._source.where(written)
        return self._nodes

    def _warn(self, written: str, message: str, hint: str) -> None:
        where = self._source.where(written)
        self._nodes.findings.append(Finding(where, message, hint, Severity.WARNING))

    def _error(self, written: str, message: str, hint: str = "") -> None:
        self._nodes.findings.append(Finding(self._source.where(written), message, hint))

    def _node(self, data: dict[str, Any]) -> Ref:
        """Add a node object and the nodes in it; return a reference to it."""
        written = data.get("@index", "")
        id = self._identify(data, written)
        if data.keys() <= {"@id", "@index"}:
            return Ref(id)
        node = self._nodes.get(id)
        for kind in data.get("@type", ()):
            if kind.startswith(UNKNOWN):
                self._types.setdefault(kind.removeprefix(UNKNOWN), written)
                self._ignore(kind, written)
            else:
                node.add_type(self._checked(kind, written))
        for predicate, values in data.items():
            if predicate in ("@graph", "@included"):
                for part in values:
                    self._node(part)
            elif predicate == "@reverse":
                for verb, subjects in values.items():
                    for subject in subjects:
                        self._nodes.get(self._node(subject)).add(verb, Ref(id))
            elif predicate.startswith(UNKNOWN):
                self._ignore(predicate, written)
            elif predicate[:1] != "@":
                self._add(node, self._checked(predicate, written), values, written)
        return Ref(id)

    def _add(self, node: Node, predicate: str, values: list[Any], written: str) -> None:
        for item in values:
            value = self._value(item, written)
            if value is not None:
                node.add(predicate, value)

    def _ignore(self, iri: str, written: str) -> None:
        self._unknown.setdefault(iri.removeprefix(UNKNOWN), []).append(written)

    def _identify(self, data: dict[str, Any], written: str) -> str:
        id: str | None = data.get("@id")
        if id is None:
            self._blanks += 1
            # With a space: labels in a document have none.
            id = f"_:{self._source.file}# {self._blanks}"
        elif id.startswith("_:"):
            id = f"_:{self._source.file}#{id[2:]}"
        # What a unit or kind without a context may have meant is known where those are read.
        elif not id.startswith(UNKNOWN):
            self._checked(id, written or id)
        if len(data) > 2 or "@id" not in data:
            self._written.setdefault(id, written)
        return id

    def _checked(self, iri: str, written: str) -> str:
        if _NO_IRI.search(iri):
            self._error(written, f'"{iri}" is no IRI', "an address has neither spaces nor brackets")
        return iri

    def _value(self, item: dict[str, Any], written: str) -> Value | None:
        if "@list" in item:
            values = (self._value(part, written) for part in item["@list"])
            return tuple(value for value in values if value is not None)
        if "@value" in item:
            return self._literal(item["@value"], item.get("@type", ""), written)
        return self._node(item)

    def _literal(self, value: Any, kind: str, written: str) -> Value | None:
        if isinstance(value, bool):
            return value
        if kind in _NUMERIC or isinstance(value, int | float):
            try:
                number = float(value)
            except (TypeError, ValueError, OverflowError):
                self._error(written, f"{_short(value)} of {_called(written)} is not a number")
                return None
            if not math.isfinite(number):
                self._error(written, f"a number of {_called(written)} is not finite")
                return None
            # 1 of a term typed as double is 1.0, as in RDF.
            return value if isinstance(value, int) and kind != _DOUBLE else number
        if isinstance(value, str):
            return value
        self._error(written, f"{_short(value)} is no value")
        return None


def _called(written: str) -> str:
    return written or "a node without @id"


def _short(value: Any) -> str:
    shown = json.dumps(value, ensure_ascii=False, default=str)
    return shown if len(shown) <= 40 else f"{shown[:39]}…"


class _JsonSource:
    """The text of a JSON-LD document, able to tell where an ``@id`` stands in it."""

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self.file = file

    @cached_property
    def _ids(self) -> dict[str, int]:
        return {match[1]: match.start() for match in reversed(list(_ID.finditer(self.text)))}

    @cached_property
    def _source(self) -> SourceText:
        return SourceText(self.text, self.file)

    def parsed(self) -> Any:
        """Return the JSON in the text; raises :class:`InputError` when it is none."""
        try:
            return json.loads(self.text, object_pairs_hook=_unique, parse_constant=_refused)
        except json.JSONDecodeError as error:
            where = Where(self.file, error.lineno, error.colno)
            raise InputError.at(where, f"is not JSON: {error.msg}") from error
        except (RecursionError, ValueError) as error:
            reason = str(error) if isinstance(error, ValueError) else "it is nested too deeply"
            if "int_max_str_digits" in reason:
                reason = "a number has thousands of digits"
            raise InputError.at(self._fault(error), f"is not JSON: {reason}") from error

    def _fault(self, error: Exception) -> Where:
        """Return where something stands that the JSON reader refuses without a place."""
        words = re.search(r'the key ("[^"]*")|^(-?Infinity|NaN)', str(error))
        pattern = r"-?\d{1000,}|[\[{](?:\s*[\[{]){20}"
        if words is not None:
            pattern = re.escape(words[1] or words[2])
        places = [match.start() for match in re.finditer(pattern, self.text)]
        last = words is not None and words[1] is not None
        return self._source.where(places[-1 if last else 0] if places else 0)

    def where(self, id: Any) -> Where:
        """Return where an ``@id``, as written, first stands."""
        position = self._ids.get(id) if isinstance(id, str) else None
        return Where(self.file, 1, 1) if position is None else self._source.where(position)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        raise ValueError(f'the key "{twice}" is written twice in one object')
    return found


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is not a number")
