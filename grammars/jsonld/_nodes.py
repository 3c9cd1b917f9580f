"""A graph as nodes with typed values: what documents expand to and rdflib graphs are read into.

Plain dictionaries, because everything that writes, reads or checks composable models walks them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from grammars.text.diagnostics import Finding, Severity, Where


class Ref(str):
    """An IRI or blank node that stands as a value."""

    __slots__ = ()


Value: TypeAlias = "Ref | str | float | int | bool | tuple[Value, ...]"
"""A reference, a literal, or an ordered list of values."""


@dataclass(slots=True)
class Node:
    """Everything said about one IRI; ``values`` by predicate, in the order they were said."""

    id: str
    types: list[str] = field(default_factory=list)
    values: dict[str, list[Value]] = field(default_factory=dict)

    def add(self, predicate: str, value: Value) -> None:
        """Say something more; what was said already is not repeated."""
        known = self.values.setdefault(predicate, [])
        # A graph is a set of statements: layers that say the same say it once.
        if value not in known:
            known.append(value)

    def add_type(self, kind: str) -> None:
        """Give the node one more type."""
        if kind not in self.types:
            self.types.append(kind)

    def all(self, predicate: str) -> list[Value]:
        """Return every value of ``predicate``."""
        return self.values.get(predicate, [])

    def refs(self, predicate: str) -> list[Ref]:
        """Return every reference among the values of ``predicate``, lists opened."""
        return list(_references(self.values.get(predicate, ())))

    def ref(self, predicate: str) -> Ref | None:
        """Return the first reference among the values of ``predicate``."""
        for value in self.values.get(predicate, ()):
            if isinstance(value, Ref):
                return value
        return None

    def number(self, predicate: str) -> float | None:
        """Return the first number among the values of ``predicate``."""
        for value in self.values.get(predicate, ()):
            if isinstance(value, int | float) and not isinstance(value, bool):
                return float(value)
        return None

    def text(self, predicate: str) -> str | None:
        """Return the first text among the values of ``predicate``."""
        for value in self.values.get(predicate, ()):
            if isinstance(value, str) and not isinstance(value, Ref):
                return value
        return None


def _references(values: list[Value] | tuple[Value, ...]) -> Iterator[Ref]:
    for value in values:
        if isinstance(value, Ref):
            yield value
        elif isinstance(value, tuple):
            yield from _references(value)


@dataclass(slots=True)
class NodeGraph:
    """A whole graph: nodes by IRI, where they were written, and what was found on the way.

    ``is_earlier`` if a document names contexts by an address they no longer have.
    """

    by_id: dict[str, Node] = field(default_factory=dict)
    places: dict[str, Where] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    is_earlier: bool = False

    def get(self, id: str) -> Node:
        """Return the node called ``id``, made when there is none yet."""
        node = self.by_id.get(id)
        if node is None:
            node = self.by_id[id] = Node(id)
        return node

    def of_type(self, kind: str) -> list[Node]:
        """Return the nodes of a type, in the order they came."""
        return [node for node in self.by_id.values() if kind in node.types]

    def where(self, id: str, default: Where | None = None) -> Where:
        """Return where ``id`` was written."""
        return self.places.get(id) or default or Where(_shown(id))

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The errors among the diagnostics, each once."""
        errors = (d for d in self.findings if d.severity is Severity.ERROR)
        return tuple(dict.fromkeys(errors))

    def add_error(self, id: str, message: str, hint: str = "") -> None:
        """Note an error about ``id``."""
        self.findings.append(Finding(self.where(id), message, hint))

    def add_warning(self, id: str, message: str, hint: str = "") -> None:
        """Note a warning about ``id``."""
        self.findings.append(Finding(self.where(id), message, hint, Severity.WARNING))

    def merge(self, other: NodeGraph) -> None:
        """Take over everything ``other`` says; equal IRIs become one node."""
        for id, node in other.by_id.items():
            mine = self.by_id.get(id)
            if mine is None:
                self.by_id[id] = node
                continue
            for kind in node.types:
                mine.add_type(kind)
            for predicate, values in node.values.items():
                for value in values:
                    mine.add(predicate, value)
        for id, where in other.places.items():
            self.places.setdefault(id, where)
        self.findings.extend(other.findings)
        self.is_earlier |= other.is_earlier


def _shown(id: str) -> str:
    return id if id.startswith("_:") else f"<{id}>"


def index_by(nodes: Mapping[str, Node], kind: str, predicate: str) -> dict[str, list[Node]]:
    """Return the nodes of type ``kind`` by what their ``predicate`` refers to."""
    found: dict[str, list[Node]] = {}
    for node in nodes.values():
        if kind in node.types:
            for target in node.refs(predicate):
                found.setdefault(target, []).append(node)
    return found
