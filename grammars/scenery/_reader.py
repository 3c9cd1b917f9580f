"""Reader of the common parts of statements: names, quantities, frames, subjects, options."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias, TypeVar

from grammars.scenery.model import (
    Amount,
    FrameName,
    Measure,
    Path,
    Subject,
    Word,
    parse_measure,
)
from grammars.text.diagnostics import (
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    rule_of,
)

T = TypeVar("T")

Options: TypeAlias = dict[str, SyntaxNode]
"""The options of a sentence by the names of their rules."""


class SceneryReader(Findings):
    """Converts nodes of the syntax tree to values and collects findings.

    An invalid quantity is reported and becomes NaN, so that the rest of its statement is read too.
    """

    def __init__(self, source: SourceText) -> None:
        super().__init__(source)
        self._text = source.text

    def refusal(self, place: SyntaxNode | Where, message: str, hint: str = "") -> InputError:
        """Return an error that ends the reading of a statement."""
        return InputError.at(self.where(place), message, hint)

    def read_all(
        self, nodes: Iterable[SyntaxNode], read: Callable[[SceneryReader, SyntaxNode], T]
    ) -> list[T]:
        """Return the values of all valid nodes and report the others."""
        values: list[T] = []
        for node in nodes:
            with self.collecting():
                values.append(read(self, node))
        return values

    def name(self, node: SyntaxNode) -> Word:
        """Read a word."""
        return Word(node.text, self.where(node))

    def measure(self, node: SyntaxNode, *dimensions: str) -> Measure:
        """Read a quantity of one of ``dimensions``, or of any if none are given."""
        where = self.where(node)
        with self.collecting():
            beside = self._text[node._tx_position_end :].partition("\n")[0]
            return parse_measure(node.text, where, *dimensions, beside=beside)
        return Measure(math.nan, "", node.text, where)

    def value(self, node: SyntaxNode | None, *dimensions: str) -> float:
        """Read a quantity of one of ``dimensions`` in SI units; 0 without a node."""
        return 0.0 if node is None else self.measure(node, *dimensions).value

    def amount(self, node: SyntaxNode, *dimensions: str) -> Amount:
        """Read a name, or a quantity of one of ``dimensions``."""
        return self.name(node) if rule_of(node) == "Word" else self.measure(node, *dimensions)

    def optional(self, node: SyntaxNode | None, *dimensions: str) -> Amount | None:
        """Read an optional amount."""
        return None if node is None else self.amount(node, *dimensions)

    def option(self, options: Options, rule: str, *dimensions: str) -> Amount | None:
        """Read the amount of an option, if present."""
        return self.amount(options[rule].value, *dimensions) if rule in options else None

    def path(self, node: SyntaxNode) -> Path:
        """Read ``object`` or ``object.joint``."""
        return Path(node.object, node.joint or "", self.where(node))

    def frame(self, node: SyntaxNode) -> FrameName:
        """Read the name of a frame of the floor plan."""
        wall = node.wall if node.walls else None
        return FrameName(node.name, wall, node.part or "", self.where(node))

    def subject(self, node: SyntaxNode) -> Subject:
        """Read the subject of a sentence."""
        names, exceptions = (tuple(map(self.path, n)) for n in (node.names, node.exceptions))
        return Subject(bool(node.every), names, exceptions, self.where(node))

    def options(self, nodes: Iterable[Any]) -> Options:
        """Return options by the names of their rules; duplicates are errors."""
        options: Options = {}
        for node in nodes:
            if rule_of(node) in options:
                self.error(node, f'"{node.keyword}" is written twice')
            # The first one counts, so that one mistake gives one message.
            options.setdefault(rule_of(node), node)
        return options
