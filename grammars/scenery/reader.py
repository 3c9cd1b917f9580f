"""What every part of the reader needs: places of parse tree nodes, measures, collected errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, TypeVar

from grammars.diagnostics import Diagnostic, InputError, Where
from grammars.scenery.language import Places
from grammars.scenery.model import Amount, FrameName, Name, Path, Subject
from grammars.scenery.units import Measure, measure, require

T = TypeVar("T")


class Reader:
    """Turns parse tree nodes into values and collects what is wrong with them."""

    def __init__(self, places: Places) -> None:
        self._places = places
        self.findings: list[Diagnostic] = []

    def where(self, node: Any) -> Where:
        """Return where ``node`` starts."""
        return self._places.at(node._tx_position)

    def report(self, where: Where, message: str, hint: str = "") -> None:
        """Note an error and go on."""
        self.findings.append(Diagnostic(where, message, hint))

    def attempt(self, read: Callable[[], T]) -> T | None:
        """Return ``read()``, or ``None`` after noting the errors it raised."""
        try:
            return read()
        except InputError as error:
            self.findings.extend(error.diagnostics)
            return None

    def each(self, nodes: Iterable[Any], read: Callable[[Any], T]) -> list[T]:
        """Return ``read(node)`` of all nodes that are in order; the others are noted."""
        values = [self.attempt(partial(read, node)) for node in nodes]
        return [value for value in values if value is not None]

    def name(self, node: Any) -> Name:
        """Read a word."""
        return Name(str(node.text), self.where(node))

    def measure(self, node: Any) -> Measure:
        """Read a number with its unit."""
        return measure(f"{node.number} {node.unit}", self.where(node))

    def value(self, node: Any, *dimensions: str, default: float = 0.0) -> float:
        """Read a quantity of one of ``dimensions`` in SI units; ``default`` when it is absent."""
        return default if node is None else require(self.measure(node), *dimensions)

    def amount(self, node: Any, *dimensions: str) -> Amount:
        """Read a quantity or a name; a quantity must have one of ``dimensions`` (if any)."""
        if type(node).__name__ == "Word":
            return self.name(node)
        given = self.measure(node)
        if dimensions:
            require(given, *dimensions)
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

    def once(self, options: Any) -> dict[str, Any]:
        """Return options by class name; one that is written twice is an error."""
        found: dict[str, Any] = {}
        for option in options:
            kind = type(option).__name__
            if kind in found:
                self.report(self.where(option), f'"{option.keyword}" is written twice')
            found.setdefault(kind, option)
        return found
