"""The only module that needs rdflib: nodes as a graph to query, any graph as nodes, SHACL checks.

Imported where it is used, so that loading and checking layers stays fast: rdflib and pyshacl take
0.2 s to import, and SHACL on the demo a second more. What the structural rules need of the shapes
is therefore written to a file once, by ``python -m grammars.jsonld.rdf``.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from rdflib import BNode, Graph, Literal, URIRef
from rdflib.collection import Collection
from rdflib.namespace import RDF, SH
from rdflib.term import Node as Term

from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value
from grammars.jsonld._references import REFERENCES_FILE
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
        self.diagnostics: tuple[Diagnostic, ...] = ()


def graph_of(nodes: NodeGraph) -> ModelGraph:
    """Return an rdflib graph that says what ``nodes`` say; numbers keep every digit."""
    graph = ModelGraph()
    for prefix, namespace in PREFIXES.items():
        graph.bind(prefix, str(namespace))
    graph.places = dict(nodes.places)
    graph.diagnostics = tuple(nodes.diagnostics)
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
        # 1, 1.0 and True are equal keys but different literals, and so are 0.0 and -0.0.
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
                self._nodes.add_error(self.name(head), "a list of the graph is broken")
                return None
            seen.add(cell)
            value = self.value(parts[str(RDF.first)], depth + 1)
            if value is not None:
                found.append(value)
            cell = parts[str(RDF.rest)]
        return tuple(found)


_FOLDER: Final = Path(__file__).with_name("shapes")


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
    results = [_result(report, node, places) for node in report.subjects(SH.focusNode, None)]
    # By message too: the report of a graph is itself a graph, without an order.
    return tuple(d for _, d in sorted(results, key=lambda pair: (pair[0], pair[1].message)))


def _result(report: Any, node: Any, places: Mapping[str, Where]) -> tuple[str, Diagnostic]:
    focus = str(report.value(node, SH.focusNode))
    message = str(report.value(node, SH.resultMessage) or "does not fit its shape")
    value = report.value(node, SH.value)
    found = f", found {local_name(str(value))}" if value is not None and str(value) != focus else ""
    warning = report.value(node, SH.resultSeverity) == SH.Warning
    return focus, Diagnostic(
        places.get(focus) or Where(f"<{focus}>"),
        f"{local_name(focus)}: {message}{found}",
        "",
        Severity.WARNING if warning else Severity.ERROR,
    )


def reference_rules() -> dict[str, dict[str, Any]]:
    """Return what the shapes say about each reference, for the structural rules.

    By predicate: ``classes`` of what it may refer to, by class of the subject where that matters
    (else by ``""``); whether it may have ``several`` values; whether its loss is ``harmless``.
    """
    graph = shapes()
    rules: dict[str, dict[str, Any]] = {}
    for target, part in _property_shapes(graph):
        path = graph.value(part, SH.path)
        limit = graph.value(part, SH.maxCount)
        for predicate in _predicates(graph, path):
            rule = rules.setdefault(predicate, {"classes": {}, "limits": [], "harmless": False})
            kinds = rule["classes"].setdefault(target, [])
            kinds += [kind for kind in _kinds(graph, part) if kind not in kinds]
            if kinds and graph.value(part, SH.severity) == SH.Warning:
                rule["harmless"] = True
            if not _is_list_path(graph, path):
                rule["limits"].append(None if limit is None else int(str(limit)))
    made = {predicate: _rule(**rules[predicate]) for predicate in sorted(rules)}
    return {p: rule for p, rule in made.items() if any(rule["classes"].values()) or rule["several"]}


def _rule(
    classes: dict[str, list[str]], limits: list[int | None], harmless: bool
) -> dict[str, Any]:
    also = classes.pop("", [])
    by_class = {target: kinds for target, kinds in classes.items() if kinds}
    if len({tuple(kinds) for kinds in by_class.values()}) <= 1:
        by_class = {"": next(iter(by_class.values()), [])}
    given = [limit for limit in limits if limit is not None]
    return {
        "classes": {
            target: [*kinds, *(kind for kind in also if kind not in kinds)]
            for target, kinds in by_class.items()
        },
        "several": max(given, default=2) > 1,
        "harmless": harmless,
    }


def _property_shapes(graph: Graph) -> Iterator[tuple[str, Term]]:
    """Return every property shape with the class of its subjects; those of any subject last."""
    for shape in sorted(set(graph.subjects(SH.property)), key=str):
        for target in sorted(graph.objects(shape, SH.targetClass), key=str):
            for part in graph.objects(shape, SH.property):
                yield str(target), part
    for shape in sorted(graph.subjects(RDF.type, SH.PropertyShape), key=str):
        yield "", shape


def _predicates(graph: Graph, path: Any) -> list[str]:
    """Return the predicates a path begins with."""
    if isinstance(path, URIRef):
        return [str(path)]
    either = graph.value(path, SH.alternativePath)
    members = list(Collection(graph, either or path))
    return [str(member) for member in (members if either else members[:1])]


def _is_list_path(graph: Graph, path: Any) -> bool:
    """Return whether a path goes into an ordered list: its counts are of the members."""
    return graph.value(path, RDF.first) is not None


def _kinds(graph: Graph, shape: Term) -> list[str]:
    """Return the classes a property shape allows, in the order they are written."""
    either = graph.value(shape, SH["or"])
    parts = [shape, *(Collection(graph, either) if either else ())]
    return [str(kind) for part in parts for kind in graph.objects(part, SH["class"])]


def references_text() -> str:
    """Return :func:`reference_rules` as they stand in the file, one line each."""
    lines = (f"{json.dumps(p)}: {json.dumps(rule)}" for p, rule in reference_rules().items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    REFERENCES_FILE.write_text(references_text(), encoding="utf-8")
