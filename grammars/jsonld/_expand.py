"""Expansion of a JSON-LD document to nodes; errors name their place in the text.

JSON is read strictly, and PyLD expands it. Keys and types that no context defines get their own
IRIs (``UNKNOWN``), so that they are reported instead of vanishing.
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
    contexts_by_type,
)
from grammars.text.diagnostics import Finding, InputError, Severity, SourceText, Where

# Documents come from outside: one may have a million mistakes, and contexts may refer to each other
# in a circle.
_MOST_FINDINGS: Final = 50
_MOST_CONTEXTS: Final = 64
_ID: Final = re.compile(r'"(?:@id|id)"\s*:\s*"([^"\\]*)"')
_NO_IRI: Final = re.compile(r'[\x00-\x20<>"{}|\\^`]')
_DOUBLE: Final = XSD["double"]
_NUMERIC: Final = frozenset(
    XSD[name] for name in ("double", "float", "decimal", "integer", "int", "long")
)


def expand_text(text: str, file: str, base: str = "") -> NodeGraph:
    """Return the nodes of the JSON-LD ``text``.

    Relative identifiers resolve against the ``@base`` of the text, otherwise ``base``, otherwise
    the address of ``file``. Raises :class:`InputError` with all errors.
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
            # Expand again, with the contexts of those types in front of the document's own.
            reader = _NodeReader(source, process(document, sorted(missing)))
    except Exception as error:
        # PyLD lets any Python error escape for some malformed documents.
        raise InputError(_problems(source, document, process, error)) from error
    return reader.finished(outdated, missing)


def _parts(document: Any) -> list[Any]:
    """Return the nodes on the highest level of a document."""
    inner = document.get("@graph", document) if isinstance(document, dict) else document
    return inner if isinstance(inner, list) else [inner]


_Process = Callable[[Any, Iterable[str]], list[Any]]


def _processor(base: str, outdated: set[str]) -> _Process:
    """Return PyLD's expansion with our stored contexts, without network access.

    ``outdated`` collects former addresses of contexts.
    """
    # PyLD is slow to import, and few layers are JSON-LD.
    from pyld import jsonld
    from pyld.context_resolver import ContextResolver

    def load(address: str, options: Any = None) -> dict[str, Any]:
        context = context_for(address, outdated)
        return {"document": {"@context": context}, "documentUrl": address, "contextUrl": None}

    def process(document: Any, contexts: Iterable[str]) -> list[Any]:
        options = {
            "base": base,
            "expandContext": [*contexts, {"@vocab": UNKNOWN}],
            "documentLoader": load,
            "contextResolver": ContextResolver({}, load, _MOST_CONTEXTS),
        }
        expanded: list[Any] = jsonld.expand(document, options)
        return expanded

    return process


def _mark_nodes(item: Any) -> None:
    """Store the written identifier of every node as its ``@index``, which expansion keeps."""
    if isinstance(item, list):
        for part in item:
            _mark_nodes(part)
    elif isinstance(item, dict):
        for key, part in item.items():
            if key != "@context":
                _mark_nodes(part)
        label = item.get("@id", item.get("id"))
        if isinstance(label, str):
            item["@index"] = label


def _problems(
    source: _JsonSource, document: Any, process: _Process, error: Exception
) -> Iterable[Finding]:
    """Return the errors of each node by itself, or ``error`` if every node alone is valid."""
    whole = document if isinstance(document, dict) and "@graph" in document else {}
    findings: list[Finding] = []
    # The contexts alone come first: with a broken one, no node can be checked.
    for node in ({}, *_parts(document)):
        try:
            process({**whole, "@graph": [node]}, ())
        except Exception as fault:
            findings.append(Finding(source.where(node.get("@id")), _explanation(fault)))
            if not node or len(findings) == _MOST_FINDINGS:
                break
    return findings or [Finding(source.where(None), _explanation(error))]


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
    """Reader of an expanded document into nodes."""

    def __init__(self, source: _JsonSource, expanded: list[Any]) -> None:
        self._source = source
        self._nodes = NodeGraph()
        self._blanks = 0
        # Identifiers as written in the document, by IRI.
        self._labels: dict[str, str] = {}
        self._unknown: dict[str, list[str]] = {}
        self._types: dict[str, str] = {}
        for node in expanded:
            self._node(node)

    def missing_contexts(self) -> dict[str, list[str]]:
        """Return, by address, published contexts that define types unknown to the document.

        Each entry lists a node that uses the first type, then the types.
        """
        by_address: dict[str, list[str]] = {}
        for name, user in self._types.items():
            address = contexts_by_type().get(name)
            if address:
                by_address.setdefault(address, [user]).append(name)
        return by_address

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
        for iri, label in self._labels.items():
            self._nodes.places[iri] = self._source.where(label)
        return self._nodes

    def _warn(self, label: str, message: str, hint: str) -> None:
        where = self._source.where(label)
        self._nodes.findings.append(Finding(where, message, hint, Severity.WARNING))

    def _error(self, label: str, message: str, hint: str = "") -> None:
        self._nodes.findings.append(Finding(self._source.where(label), message, hint))

    def _node(self, data: dict[str, Any]) -> Ref:
        """Add a node object and the nodes in it; return a reference to it."""
        label = data.get("@index", "")
        id = self._identify(data, label)
        if data.keys() <= {"@id", "@index"}:
            return Ref(id)
        node = self._nodes.get(id)
        for kind in data.get("@type", ()):
            if kind.startswith(UNKNOWN):
                self._types.setdefault(kind.removeprefix(UNKNOWN), label)
                self._ignore(kind, label)
            else:
                node.add_type(self._checked(kind, label))
        for predicate, values in data.items():
            if predicate in ("@graph", "@included"):
                for part in values:
                    self._node(part)
            elif predicate == "@reverse":
                for verb, subjects in values.items():
                    for subject in subjects:
                        self._nodes.get(self._node(subject)).add(verb, Ref(id))
            elif predicate.startswith(UNKNOWN):
                self._ignore(predicate, label)
            elif predicate[:1] != "@":
                self._add(node, self._checked(predicate, label), values, label)
        return Ref(id)

    def _add(self, node: Node, predicate: str, values: list[Any], label: str) -> None:
        for item in values:
            value = self._value(item, label)
            if value is not None:
                node.add(predicate, value)

    def _ignore(self, iri: str, label: str) -> None:
        self._unknown.setdefault(iri.removeprefix(UNKNOWN), []).append(label)

    def _identify(self, data: dict[str, Any], label: str) -> str:
        id: str | None = data.get("@id")
        if id is None:
            self._blanks += 1
            # With a space: labels in a document have none.
            id = f"_:{self._source.file}# {self._blanks}"
        elif id.startswith("_:"):
            id = f"_:{self._source.file}#{id[2:]}"
        # The readers of units and kinds report values without a context.
        elif not id.startswith(UNKNOWN):
            self._checked(id, label or id)
        if len(data) > 2 or "@id" not in data:
            self._labels.setdefault(id, label)
        return id

    def _checked(self, iri: str, label: str) -> str:
        if _NO_IRI.search(iri):
            hint = "an address has neither spaces nor brackets"
            self._error(label, f'"{iri}" is not an IRI', hint)
        return iri

    def _value(self, item: dict[str, Any], label: str) -> Value | None:
        if "@list" in item:
            values = (self._value(part, label) for part in item["@list"])
            return tuple(value for value in values if value is not None)
        if "@value" in item:
            return self._literal(item["@value"], item.get("@type", ""), label)
        return self._node(item)

    def _literal(self, value: Any, kind: str, label: str) -> Value | None:
        if isinstance(value, bool):
            return value
        if kind in _NUMERIC or isinstance(value, int | float):
            try:
                number = float(value)
            except (TypeError, ValueError, OverflowError):
                self._error(label, f"{_short(value)} of {_called(label)} is not a number")
                return None
            if not math.isfinite(number):
                self._error(label, f"a number of {_called(label)} is not finite")
                return None
            # 1 of a term typed as double is 1.0, as in RDF.
            return value if isinstance(value, int) and kind != _DOUBLE else number
        if isinstance(value, str):
            return value
        self._error(label, f"{_short(value)} is not a value")
        return None


def _called(label: str) -> str:
    return label or "a node without @id"


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 40 else f"{text[:39]}…"


class _JsonSource:
    """Text of a JSON-LD document, with the place of every ``@id``."""

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
        """Return the parsed JSON; raises :class:`InputError` if the text is not JSON."""
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
        """Return the place of an error that the JSON reader reports without a place."""
        words = re.search(r'the key ("[^"]*")|^(-?Infinity|NaN)', str(error))
        pattern = r"-?\d{1000,}|[\[{](?:\s*[\[{]){20}"
        if words is not None:
            pattern = re.escape(words[1] or words[2])
        places = [match.start() for match in re.finditer(pattern, self.text)]
        last = words is not None and words[1] is not None
        return self._source.where(places[-1 if last else 0] if places else 0)

    def where(self, id: Any) -> Where:
        """Return the first place of an ``@id`` as written."""
        position = self._ids.get(id) if isinstance(id, str) else None
        return Where(self.file, 1, 1) if position is None else self._source.where(position)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        raise ValueError(f'the key "{twice}" is written twice in one object')
    return values


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is not a number")
