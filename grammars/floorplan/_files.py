"""Files of plans: read, parsed once, compiled with other values for their variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from grammars.floorplan._attributes import LARGEST, kind_of
from grammars.floorplan._compile import compile_plan
from grammars.floorplan._syntax import parse_syntax
from grammars.floorplan.model import FloorPlan
from grammars.text.diagnostics import (
    Finding,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
    with_article,
)
from grammars.text.quantity import parse_quantity
from grammars.text.sources import read_text
from grammars.text.units import to_si


def load_floorplan(path: str | Path) -> FloorPlan:
    """Read and compile a ``.fpm`` file (UTF-8).

    Raises :class:`InputError` with all errors; warnings are in the plan.
    """
    return read_floorplan(path).compile()


@dataclass(frozen=True, slots=True, eq=False)
class PlanVariable:
    """Variable of a plan: ``value`` [m or rad], ``text`` as written, and its place."""

    name: str
    value: float
    dimension: str
    text: str
    where: Where


@dataclass(frozen=True, slots=True, eq=False)
class ParsedFloorPlan:
    """Parsed plan that can be compiled many times with different values."""

    source: SourceText
    _tree: SyntaxNode

    def compile(
        self,
        values: Mapping[str, object] | None = None,
        where: Where | None = None,
        places: Mapping[str, Where] | None = None,
    ) -> FloorPlan:
        """Return the plan, as :func:`load_floorplan` does.

        ``values`` replace values of variables; they are text such as ``"0.8 m"``, written at
        ``where``. ``places`` holds the exact place of a value, if known.
        """
        whole = where or Where(self.source.file)
        numbers = _read_values(self._tree, values, whole, places or {}) if values else {}
        return compile_plan(self._tree, self.source, numbers)

    @property
    def variables(self) -> tuple[PlanVariable, ...]:
        """The variables of the plan, in the order they are written."""
        return tuple(
            PlanVariable(
                node.name,
                to_si(float(node.number), node.unit),
                kind_of(node.unit),
                f"{node.number} {node.unit}",
                self.source.at(node),
            )
            for node in self._tree.variables
        )


def read_floorplan(path: str | Path) -> ParsedFloorPlan:
    """Read and parse a ``.fpm`` file; raises :class:`InputError` if it is not a plan."""
    source = SourceText(read_text(path, "the plan"), str(path))
    return ParsedFloorPlan(source, parse_syntax(source))


def parse_floorplan(text: str, file: str = "<text>") -> FloorPlan:
    """Compile the text of a plan; diagnostics name it ``file``.

    Raises :class:`InputError` with all errors; warnings are in the plan.
    """
    source = SourceText(text, file)
    return compile_plan(parse_syntax(source), source)


def _read_values(
    tree: SyntaxNode, values: Mapping[str, object], whole: Where, places: Mapping[str, Where]
) -> dict[str, float]:
    """Return the values of variables in SI units; raises :class:`InputError` with all errors."""
    variables = {variable.name: variable for variable in tree.variables}
    read: dict[str, float] = {}
    faults: list[Finding] = []
    for key, value in values.items():
        # Campaigns are YAML, where names are written with dashes.
        name = str(key).replace("-", "_")
        where = places.get(str(key), whole)
        variable = variables.get(name)
        if variable is None:
            hint = did_you_mean(name, variables) or "the plan has no variables"
            faults.append(Finding(where, f'plan {tree.name} has no variable "{key}"', hint))
            continue
        example = f"write {name}: {variable.number} {variable.unit}"
        try:
            quantity = parse_quantity(str(value), where)
        except InputError as error:
            faults.extend(error.findings)
            continue
        kind = kind_of(variable.unit)
        if quantity.dimension != kind:
            message = f"{name} is {with_article(kind)}, not {value}"
            faults.append(Finding(where, message, example))
        elif abs(quantity.value) > LARGEST:
            faults.append(Finding(where, f"{name}: {value} is too large", "the limit is 1000 km"))
        else:
            read[name] = quantity.value
    if faults:
        raise InputError(faults)
    return read
