"""The only module that needs rdflib: nodes as a graph to query, any graph as nodes, SHACL checks.

Imported where it is used, so that loading and checking layers stays fast.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rdflib import BNode, Graph, Literal, URIRef
from rdflib.namespace import RDF
from rdflib.term import Node as Term

from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value
from grammars.jsonld.vocabulary import (
    COORD,
    DYN,
    FP,
    GEOM,
    GZB,
    ITEMS,
    KC,
    KC_STATE,
    OBJ,
    POLY,
    QUDT,
    REL,
    SCN,
    ST,
    UNIT,
    XSD,
    local_name,
)
from grammars.text.diagnostics import Diagnostic, Severity, Where

PREFIXES: Final = {
    "geom": GEOM,
    "geom-rel": REL,
    "geom-coord": COORD,
    "kc": KC,
    "kc-stat": KC_STATE,
    "dyn": DYN,
    "poly": POLY,
    "floorplan": FP,
    "obj": OBJ,
    "st": ST,
    "gzb": GZB,
    "qudt": QUDT,
    "unit": UNIT,
    "scn": SCN,
    "item": ITEMS,
}
_DOUBLE: Final = URIRef(XSD["double"])


class ModelGraph(Graph):
    """An rdflib graph that knows where its nodes were written and what was found in them."""

    def __init__(self) -> None:
        super().__init__()
        self.places: dict[str, Where] = {}
        self.findings: tuple[Diagnostic, ...] = ()


def graph_of(nodes: NodeGraph) -> ModelGraph:
    """Return an rdflib graph that says what ``nodes`` say; numbers keep every digit."""
    graph = ModelGraph()
    for prefix, namespace in PREFIXES.items():
        graph.bind(prefix, str(namespace))
    graph.places = dict(nodes.places)
    graph.findings = tuple(nodes.findings)
    _GraphFiller(graph).fill(nodes)
    return graph


class _GraphFiller:
    """Adds nodes to a graph; terms are made once."""

    def __init__(self, graph: Graph) -> None:
        self._store: Any = graph.store
        self._graph = graph
        self._terms: dict[str, URIRef | BNode] = {}
        self._literals: dict[tuple[type, Any], Literal] = {}
        self._lists = 0

    def fill(self, nodes: NodeGraph) -> None:
        for node in nodes.by_id.values():
            subject = self._term(node.id)
            for kind in node.types:
                self._add(subject, RDF.type, self._term(kind))
            for predicate, values in node.values.items():
                verb = self._term(predicate)
                for value in values:
                    self._add(subject, verb, self._value(value))

    def _add(self, subject: Term, predicate: Term, value: Term) -> None:
        # The store directly: Graph.add checks types that are right by construction.
        self._store.add((subject, predicate, value), self._graph)

    def _term(self, id: str) -> URIRef | BNode:
        term = self._terms.get(id)
        if term is None:
            term = BNode(f"b{len(self._terms)}") if id.startswith("_:") else URIRef(id)
            self._terms[id] = term
        return term

    def _value(self, value: Value) -> Term:
        if isinstance(value, Ref):
            return self._term(value)
        if isinstance(value, tuple):
            return self._list(value)
        key = (type(value), value if value != 0 else repr(value))
        literal = self._literals.get(key)
        if literal is None:
            literal = (
                Literal(repr(value), datatype=_DOUBLE, normalize=False)
                if isinstance(value, float)
                else Literal(value)
            )
            self._literals[key] = literal
        return literal

    def _list(self, items: tuple[Value, ...]) -> Term:
        head: Term = RDF.nil
        for item in reversed(items):
            self._lists += 1
            cell = BNode(f"l{self._lists}")
            self._add(cell, RDF.first, self._value(item))
            self._add(cell, RDF.rest, head)
            head = cell
        return head


def nodes_of(graph: Graph) -> NodeGraph:
    """Return what ``graph`` says as nodes, in an order that depends on its content only.

    Lists become tuples; cells of broken lists are reported as errors.
    """
    nodes = NodeGraph(places=dict(getattr(graph, "places", {})))
    cells: dict[Term, dict[str, Term]] = {}
    first, rest = RDF.first, RDF.rest
    plain: list[tuple[Term, Term, Term]] = []
    for triple in graph:
        if triple[1] == first or triple[1] == rest:
            cells.setdefault(triple[0], {})[str(triple[1])] = triple[2]
        else:
            plain.append(triple)
    names: dict[Term, str] = {}
    reader = _GraphReader(nodes, cells, names)
    # Sorting makes reading independent of the order of the store.
    for subject, predicate, value in sorted(plain, key=_sort_key):
        node = nodes.get(reader.name(subject))
        if predicate == RDF.type:
            node.add_type(str(value))
        else:
            _add(node, str(predicate), reader.value(value, 0))
    return nodes


def _sort_key(triple: tuple[Term, Term, Term]) -> tuple[str, str, str]:
    return (str(triple[0]), str(triple[1]), str(triple[2]))


def _add(node: Node, predicate: str, value: Value | None) -> None:
    if value is not None:
        node.add(predicate, value)


class _GraphReader:
    def __init__(
        self, nodes: NodeGraph, cells: dict[Term, dict[str, Term]], names: dict[Term, str]
    ) -> None:
        self._nodes = nodes
        self._cells = cells
        self._names = names

    def name(self, term: Term) -> str:
        name = self._names.get(term)
        if name is None:
            name = f"_:{term}" if isinstance(term, BNode) else str(term)
            self._names[term] = name
        return name

    def value(self, term: Term, depth: int) -> Value | None:
        if term == RDF.nil:
            return ()
        if term in self._cells:
            return self._list(term, depth)
        if not isinstance(term, Literal):
            return Ref(self.name(term))
        value = term.value
        if isinstance(value, bool | int | float | str):
            return value
        try:
            return float(str(term)) if value is not None else str(term)
        except ValueError:
            return str(term)

    def _list(self, head: Term, depth: int) -> tuple[Value, ...] | None:
        found: list[Value] = []
        seen: set[Term] = set()
        cell = head
        while cell != RDF.nil:
            parts = self._cells.get(cell, {})
            if cell in seen or len(parts) != 2 or depth > 8:
                self._nodes.error(self.name(head), "a list of the graph is broken")
                return None
            seen.add(cell)
            value = self.value(parts[str(RDF.first)], depth + 1)
            if value is not None:
                found.append(value)
            cell = parts[str(RDF.rest)]
        return tuple(found)


_FOLDER: Final = Path(__file__).with_name("shapes")
_SH: Final = "http://www.w3.org/ns/shacl#"


@functools.cache
def shapes() -> Graph:
    """Return the shapes of everything a composed graph may contain."""
    graph = Graph()
    for file in sorted(_FOLDER.glob("*.ttl")):
        graph.parse(file, format="turtle")
    return graph


def check_shapes(graph: Graph, places: Mapping[str, Where]) -> tuple[Diagnostic, ...]:
    """Return every violation of the shapes, sorted by element."""
    from pyshacl import validate

    conforms, report, _ = validate(
        graph,
        shacl_graph=shapes(),
        inference="none",
        advanced=False,
        inplace=True,
        meta_shacl=False,
    )
    if conforms:
        return ()
    results = [_result(report, node, places) for node in report.subjects(_sh("focusNode"), None)]
    return tuple(d for _, d in sorted(results, key=lambda pair: pair[0]))


def _result(
    report: Any, node: Any, places: Mapping[str, Where]
) -> tuple[tuple[str, str], Diagnostic]:
    focus = str(report.value(node, _sh("focusNode")))
    message = str(report.value(node, _sh("resultMessage")) or "does not fit its shape")
    value = report.value(node, _sh("value"))
    found = f", found {local_name(str(value))}" if value is not None and str(value) != focus else ""
    warning = report.value(node, _sh("resultSeverity")) == _sh("Warning")
    return (focus, message), Diagnostic(
        places.get(focus) or Where(f"<{focus}>"),
        f"{local_name(focus)}: {message}{found}",
        "",
        Severity.WARNING if warning else Severity.ERROR,
    )


def _sh(term: str) -> URIRef:
    return URIRef(_SH + term)
