"""Graph of nodes with typed values, the expanded form of documents.

It consists of plain dictionaries, because every reader and check of models walks them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from grammars.text.diagnostics import Finding, InputError, Severity, Where


class Ref(str):
    """An IRI or blank node as a value."""

    __slots__ = ()


Value: TypeAlias = "Ref | str | float | int | bool | tuple[Value, ...]"
"""A reference, a literal, or an ordered list of values."""


@dataclass(slots=True)
class Node:
    """All statements about one IRI: types, and values by predicate in the order of writing."""

    id: str
    types: list[str] = field(default_factory=list)
    values: dict[str, list[Value]] = field(default_factory=dict)

    def add(self, predicate: str, value: Value) -> None:
        """Add a value, unless the predicate already has it: a graph is a set of statements."""
        values = self.values.setdefault(predicate, [])
        if value not in values:
            values.append(value)

    def add_type(self, kind: str) -> None:
        """Add a type, unless the node already has it."""
        if kind not in self.types:
            self.types.append(kind)

    def all(self, predicate: str) -> list[Value]:
        """Return every value of ``predicate``."""
        return self.values.get(predicate, [])

    def refs(self, predicate: str) -> list[Ref]:
        """Return every reference among the values of ``predicate``, also those in lists."""
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
    """Whole graph: nodes and their places by IRI, and the findings about them.

    ``is_earlier`` holds if a document names contexts by former addresses.
    """

    by_id: dict[str, Node] = field(default_factory=dict)
    places: dict[str, Where] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    is_earlier: bool = False

    def get(self, id: str) -> Node:
        """Return the node called ``id``; add it if it does not exist."""
        node = self.by_id.get(id)
        if node is None:
            node = self.by_id[id] = Node(id)
        return node

    def of_type(self, kind: str) -> list[Node]:
        """Return the nodes of a type, in the order of writing."""
        return [node for node in self.by_id.values() if kind in node.types]

    def where(self, id: str, default: Where | None = None) -> Where:
        """Return the place of ``id`` in its file."""
        return self.places.get(id) or default or Where(_shown(id))

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The errors among the findings, each once."""
        errors = (d for d in self.findings if d.severity is Severity.ERROR)
        return tuple(dict.fromkeys(errors))

    def raise_errors(self) -> None:
        """Raise :class:`InputError` with the errors, if any."""
        if self.errors:
            raise InputError(self.errors)

    def add_error(self, id: str, message: str, hint: str = "") -> None:
        """Add an error about ``id``."""
        self.findings.append(Finding(self.where(id), message, hint))

    def add_warning(self, id: str, message: str, hint: str = "") -> None:
        """Add a warning about ``id``."""
        self.findings.append(Finding(self.where(id), message, hint, Severity.WARNING))

    def merge(self, other: NodeGraph) -> None:
        """Add all nodes and findings of ``other``; equal IRIs become one node."""
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
    """Return the nodes of type ``kind`` by the targets of their ``predicate``."""
    index: dict[str, list[Node]] = {}
    for node in nodes.values():
        if kind in node.types:
            for target in node.refs(predicate):
                index.setdefault(target, []).append(node)
    return index
