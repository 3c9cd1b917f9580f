"""From JSON-LD documents to nodes, with everything that could not be read reported in its place.

JSON is read strictly. Everything a document says arrives: terms scoped to several types of one node
are all known (rdflib applies only the first type's), keys no context knows are reported instead of
vanishing.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any, Final, NamedTuple

from grammars.jsonld._json_text import JsonText
from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value
from grammars.jsonld.vocabulary import (
    COORD,
    UNKNOWN,
    XSD,
    ContextError,
    JsonLdContext,
    Term,
    context_of_type,
    local_name,
    secoro,
)
from grammars.text.diagnostics import Diagnostic, InputError, Severity

_NO_IRI: Final = re.compile(r'[\x00-\x20<>"{}|\\^`]')
# Documents come from outside: one with a million mistakes, or lists nested without end, is refused
# after the first few.
_MOST_FINDINGS: Final = 50
_DEEPEST_LIST: Final = 8
_DOUBLE: Final = XSD["double"]
_NUMERIC: Final = frozenset(
    XSD[name] for name in ("double", "float", "decimal", "integer", "int", "long")
)
_PLAIN: Final = Term("")
_AXES: Final = ("x", "y", "z")
_COORDINATES: Final = secoro("geometry/coordinates.json")


def expand_text(text: str, file: str, base: str = "") -> NodeGraph:
    """Return what the JSON-LD ``text`` says; raises :class:`InputError` with every problem.

    Relative identifiers resolve against ``base``, or, where the text says so, its own ``@base``.
    """
    document = JsonText(text, file)
    return expand(document.parsed(), file, document, base)


def expand(data: Any, file: str, document: JsonText | None = None, base: str = "") -> NodeGraph:
    """Return what parsed JSON-LD says; raises :class:`InputError` with every problem.

    Relative identifiers resolve against ``base``.
    """
    expansion = _Expansion(document or JsonText("", file), base)
    try:
        expansion.top(data)
    except ContextError as error:
        expansion.error("", str(error))
    except RecursionError:
        expansion.error("", "is nested too deeply")
    return expansion.finished()


class _Types(NamedTuple):
    """What types as written mean in a context.

    ``typed`` is the context inside of the node, ``iris`` has each type's IRI or nothing where it
    has none, ``missing`` the published contexts of types that no context of the document defines.
    """

    typed: JsonLdContext
    iris: tuple[tuple[str, str], ...]
    missing: dict[str, str]


class _Expansion:
    """One document on its way to nodes."""

    def __init__(self, document: JsonText, base: str) -> None:
        self.document = document
        self.base = base
        self.nodes = NodeGraph()
        self.outdated: set[str] = set()
        self.blanks = 0
        self.dropped: dict[str, list[str]] = {}
        self.undefined: dict[str, tuple[dict[str, None], list[str]]] = {}
        self.written: dict[str, str] = {}
        self.good: set[str] = set()
        self.known_types: dict[tuple[JsonLdContext, tuple[str, ...]], _Types] = {}

    def error(self, id: str, message: str, hint: str = "") -> None:
        if len(self.nodes.diagnostics) < _MOST_FINDINGS:
            self.nodes.diagnostics.append(Diagnostic(self.document.where(id), message, hint))

    def warn(self, id: str, message: str, hint: str = "") -> None:
        where = self.document.where(id)
        self.nodes.diagnostics.append(Diagnostic(where, message, hint, Severity.WARNING))

    def finished(self) -> NodeGraph:
        errors = [d for d in self.nodes.diagnostics if d.severity is Severity.ERROR]
        if errors:
            raise InputError(errors)
        for address in sorted(self.outdated):
            self.warn("", f'"{address}" is an outdated address', "read as the current context")
        for address, (names, ids) in self.undefined.items():
            listed = ", ".join(names)
            message = f"no context defines {listed}, first used by {ids[0] or 'a node without @id'}"
            self.warn(ids[0], message, f"read with {address}, which RDF tools need too")
        for key, ids in self.dropped.items():
            more = f" (and in {len(ids) - 1} other nodes)" if len(ids) > 1 else ""
            self.warn(
                ids[0],
                f'"{key}" of {ids[0] or "a node without @id"}{more} is in no context: ignored',
                "RDF tools drop it; add a context that defines it or remove it",
            )
        if self.document.text:
            for iri, written in self.written.items():
                self.nodes.places[iri] = self.document.where(written)
        return self.nodes

    def top(self, data: Any) -> None:
        context = JsonLdContext(self.base, "", {})
        for item in data if isinstance(data, list) else [data]:
            if isinstance(item, dict):
                self.node(item, context, top=True)
            else:
                self.error("", f"expected nodes in braces, found {_short(item)}")

    def node(
        self, data: dict[str, Any], context: JsonLdContext, *, top: bool = False
    ) -> Ref | None:
        """Add a node object; return a reference to it (``None`` for a mere envelope)."""
        if "@context" in data:
            context = context.extended(data["@context"], self.outdated)
        terms = context.terms
        types, written, rest = self._split(data, terms)
        # A document has thousands of nodes of a few sorts.
        said = (context, tuple(types))
        means = self.known_types.get(said)
        if means is None:
            means = self.known_types[said] = self._meaning(types, context)
        typed = means.typed
        if top and written is None and any(k == "@graph" for k, _, _ in rest):
            self._envelope(rest, context)
            return None
        id = self._identify(written, typed)
        node = self.nodes.get(id)
        for name, iri in means.iris:
            address = means.missing.get(name, "")
            if address:
                names, ids = self.undefined.setdefault(address, ({}, []))
                names[name] = None
                ids.append(written or "")
            if iri:
                node.add_type(iri)
            else:
                self._drop(name, written)
        for key, _, value in rest:
            self._property(node, key, value, typed, context)
        return Ref(id)

    def _meaning(self, types: list[str], context: JsonLdContext) -> _Types:
        # Terms scoped to each of its types; rdflib knows those of the first type only.
        typed = context.for_types(types, self.outdated) if types else context
        terms = context.terms
        missing = {name: self._context_of(name, context) for name in types if name not in terms}
        for address in sorted({address for address in missing.values() if address}):
            # After the types' own contexts: what is defined there holds.
            typed = typed.completed(address).for_types(types, self.outdated)
        iris = []
        for name in types:
            address = missing.get(name, "")
            known = name in terms or ":" in name or context.vocabulary or address
            iri = (typed if address else context).iri(name, vocabulary=True) if known else ""
            iris.append((name, iri if ":" in iri and not _NO_IRI.search(iri) else ""))
        return _Types(typed, tuple(iris), missing)

    def _context_of(self, name: str, context: JsonLdContext) -> str:
        """Return the published context of a type that no context of the document defines."""
        if context.vocabulary or ":" in name or name in context.terms:
            return ""
        return context_of_type(name)

    def _split(
        self, data: dict[str, Any], terms: dict[str, Term | None]
    ) -> tuple[list[str], str | None, list[tuple[str, str, Any]]]:
        """Return types and id as written, and every other key with what it means."""
        types: list[str] = []
        written: str | None = None
        rest: list[tuple[str, str, Any]] = []
        for key, value in data.items():
            if key == "@context":
                continue
            term = terms.get(key)
            meaning = term.iri if term is not None and term.iri[:1] == "@" else key
            if meaning == "@type":
                types.extend(self._type_names(value))
            elif meaning == "@id":
                if isinstance(value, str):
                    written = value
                else:
                    self.error("", f"an @id is text, not {_short(value)}")
            else:
                rest.append((meaning, key, value))
        return types, written, rest

    def _type_names(self, value: Any) -> list[str]:
        names = value if isinstance(value, list) else [value]
        for name in names:
            if not isinstance(name, str):
                self.error("", f"a @type is text, not {_short(name)}")
        return [name for name in names if isinstance(name, str)]

    def _envelope(self, rest: list[tuple[str, str, Any]], context: JsonLdContext) -> None:
        for meaning, _, value in rest:
            if meaning != "@graph":
                self._drop(meaning, None)
                continue
            for item in value if isinstance(value, list) else [value]:
                if isinstance(item, dict):
                    self.node(item, context, top=True)
                else:
                    self.error("", f"expected nodes in @graph, found {_short(item)}")

    def _identify(self, written: str | None, context: JsonLdContext) -> str:
        if written is None:
            self.blanks += 1
            return f"_:{self.document.file}#{self.blanks}"
        id = context.iri(written, vocabulary=False)
        if id.startswith("_:"):
            return f"_:{self.document.file}#{id[2:]}"
        if ":" not in id or _NO_IRI.search(id):
            self.error(written, f'"{written}" is no IRI', "give a @base, or a prefix known here")
        self.written.setdefault(id, written)
        if context.base == self.base and ":" not in written:
            self.nodes.relative.add(id)
        return id

    def _property(
        self, node: Node, key: str, value: Any, typed: JsonLdContext, outer: JsonLdContext
    ) -> None:
        if key[:1] == "@":
            if key in ("@graph", "@included"):
                self._envelope([("@graph", key, value)], outer)
            elif key != "@index":
                self.error(self.written.get(node.id, ""), f'"{key}" is not read here')
            return
        term = typed.terms.get(key)
        if term is None and key in _AXES and _is_vector(node):
            # Files of June 2023 define the type themselves, without what the published context
            # scopes to it.
            names, ids = self.undefined.setdefault(_COORDINATES, ({}, []))
            names[key] = None
            ids.append(self.written.get(node.id, ""))
            term = Term(COORD[key], _DOUBLE)
        if term is None:
            meant = key not in typed.terms and (":" in key or bool(typed.vocabulary))
            iri = typed.iri(key, vocabulary=True) if meant else ""
            if ":" not in iri or _NO_IRI.search(iri):
                self._drop(key, self.written.get(node.id))
                return
            term = Term(iri)
        inner = outer
        if term.scoped is not None:
            inner = outer.extended(term.scoped, self.outdated)
        # One value that is no list is a list of one.
        if term.container == "@list" and not (isinstance(value, dict) and "@list" in value):
            items = value if isinstance(value, list) else [value]
            node.add(term.iri, self._list(items, term, typed, inner, node.id))
            return
        for item in value if isinstance(value, list) else [value]:
            known = self._value(item, term, typed, inner, node.id)
            if known is not None:
                node.add(term.iri, known)

    def _list(
        self,
        items: Any,
        term: Term,
        typed: JsonLdContext,
        inner: JsonLdContext,
        owner: str,
        depth: int = 0,
    ) -> tuple[Value, ...]:
        if depth > _DEEPEST_LIST:
            self.error(self.written.get(owner, ""), "a list is nested too deeply")
            return ()
        found: list[Value] = []
        for item in items if isinstance(items, list) else [items]:
            value = (
                self._list(item, term, typed, inner, owner, depth + 1)
                if isinstance(item, list)
                else self._value(item, term, typed, inner, owner)
            )
            if value is not None:
                found.append(value)
        return tuple(found)

    def _value(
        self, item: Any, term: Term, typed: JsonLdContext, inner: JsonLdContext, owner: str
    ) -> Value | None:
        if item is None:
            return None
        if isinstance(item, str):
            if term.kind == "@id":
                return Ref(self._reference(item, typed, vocabulary=False))
            if term.kind == "@vocab":
                return Ref(self._reference(item, typed, vocabulary=True))
            return self._literal(item, term.kind, owner)
        if isinstance(item, dict):
            return self._object(item, term, typed, inner, owner)
        if isinstance(item, list):
            self.error(self.written.get(owner, ""), "a list inside a set is not JSON-LD")
            return None
        return self._literal(item, term.kind, owner)

    def _reference(self, text: str, context: JsonLdContext, *, vocabulary: bool) -> str:
        iri = context.iri(text, vocabulary=vocabulary)
        if iri in self.good:
            return iri
        if iri.startswith("_:"):
            return f"_:{self.document.file}#{iri[2:]}"
        if vocabulary and ":" not in iri:
            # A word no context defines, in a text without an address: what it may have meant is
            # known where units and kinds are read.
            return UNKNOWN[iri]
        if ":" not in iri or _NO_IRI.search(iri):
            self.error(text, f'"{text}" is no IRI', "give a @base, or a prefix known here")
        self.good.add(iri)
        return iri

    def _object(
        self,
        item: dict[str, Any],
        term: Term,
        typed: JsonLdContext,
        inner: JsonLdContext,
        owner: str,
    ) -> Value | None:
        if "@value" in item:
            kind = item.get("@type") or term.kind
            kind = typed.iri(kind, vocabulary=True) if isinstance(kind, str) else ""
            return self._literal(item["@value"], kind, owner)
        if "@list" in item:
            return self._list(item["@list"], term, typed, inner, owner)
        if "@set" in item:
            self.error(self.written.get(owner, ""), "@set is not read here; write the values")
            return None
        return self.node(item, inner)

    def _literal(self, value: Any, kind: str, owner: str) -> Value | None:
        written = self.written.get(owner, "")
        if isinstance(value, bool):
            return value
        if kind in _NUMERIC or isinstance(value, int | float):
            try:
                number = float(value)
            except (TypeError, ValueError, OverflowError):
                self.error(written, f"{_short(value)} of {written or 'a node'} is not a number")
                return None
            if not math.isfinite(number):
                self.error(written, f"a number of {written or 'a node'} is not finite")
                return None
            # 1 of a term typed as double is 1.0, as in RDF.
            whole = isinstance(value, int) and kind != _DOUBLE
            return value if whole else number
        if isinstance(value, str):
            return value
        self.error(written, f"{_short(value)} is no value")
        return None

    def _drop(self, key: str, written: str | None) -> None:
        self.dropped.setdefault(key, []).append(written or "")


def _is_vector(node: Node) -> bool:
    return any(local_name(kind) in ("VectorXY", "VectorXYZ") for kind in node.types)


def _short(value: Any) -> str:
    shown = json.dumps(value, ensure_ascii=False)
    return shown if len(shown) <= 40 else f"{shown[:39]}…"
