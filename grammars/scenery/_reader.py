"""Reading what every part of the language has: names, quantities, frames, subjects, options."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final, TypeVar

from grammars.scenery.measure import Measure, parse_measure, require_dimension
from grammars.scenery.model import Amount, FrameName, Name, Path, Subject
from grammars.text.diagnostics import Diagnostic, InputError, SourceText, TypedNode, Where

T = TypeVar("T")


class WordNode(TypedNode):
    """A name."""

    text: str


class QuantityNode(TypedNode):
    """A number with its unit."""

    number: str
    unit: str


RULES: Final = (WordNode, QuantityNode)


class NodeReader:
    """Turns parse tree nodes into values and collects what is wrong with them."""

    def __init__(self, source: SourceText) -> None:
        self._source = source
        self.diagnostics: list[Diagnostic] = []

    def where(self, node: Any) -> Where:
        """Return where ``node`` starts."""
        return self._source.at(node)

    def report(self, where: Where, message: str, hint: str = "") -> None:
        """Note an error and go on."""
        self.diagnostics.append(Diagnostic(where, message, hint))

    def read_or_collect(self, read: Callable[[], T]) -> T | None:
        """Return ``read()``, or ``None`` after noting the errors it raised."""
        try:
            return read()
        except InputError as error:
            self.diagnostics.extend(error.diagnostics)
            return None

    def read_all(self, nodes: Iterable[Any], read: Callable[[Any], T]) -> list[T]:
        """Return ``read(node)`` of all nodes that are in order; the others are noted."""
        values = [self.read_or_collect(partial(read, node)) for node in nodes]
        return [value for value in values if value is not None]

    def name(self, node: Any) -> Name:
        """Read a word."""
        return Name(str(node.text), self.where(node))

    def measure(self, node: Any) -> Measure:
        """Read a number with its unit."""
        return parse_measure(f"{node.number} {node.unit}", self.where(node))

    def value(self, node: Any, *dimensions: str, default: float = 0.0) -> float:
        """Read a quantity of one of ``dimensions`` in SI units; ``default`` when it is absent."""
        return default if node is None else require_dimension(self.measure(node), *dimensions)

    def amount(self, node: Any, *dimensions: str) -> Amount:
        """Read a quantity or a name; a quantity must have one of ``dimensions`` (if any)."""
        if isinstance(node, WordNode):
            return self.name(node)
        given = self.measure(node)
        if dimensions:
            require_dimension(given, *dimensions)
        return given

    def optional(self, node: Any, *dimensions: str) -> Amount | None:
        """Read an amount that may be absent."""
        return None if node is None else self.amount(node, *dimensions)

    def path(self, node: Any) -> Path:
        """Read ``object`` or ``object.joint``."""
        joint = node.joint.text if node.joint is not None else ""
        return Path(str(node.object.text), str(joint), self.where(node))

    def frame(self, node: Any) -> FrameName:
        """Read the name of a frame of the floor plan."""
        wall = int(node.wall) if node.walls else None
        part = str(node.part.text) if node.part is not None else ""
        return FrameName(str(node.name.text), wall, part, self.where(node))

    def subject(self, node: Any) -> Subject:
        """Read whom a sentence is about."""
        return Subject(
            bool(node.every),
            tuple(self.path(n) for n in node.names),
            tuple(self.path(n) for n in node.exceptions),
            self.where(node),
        )

    def options_by_rule(self, options: Any) -> dict[str, Any]:
        """Return options by the names of their rules; one written twice is an error."""
        found: dict[str, Any] = {}
        for option in options:
            kind = type(option).__name__
            # The first one counts for what follows, so that one slip is one message.
            if kind in found:
                self.report(self.where(option), f'"{option.keyword}" is written twice')
            found.setdefault(kind, option)
        return found
