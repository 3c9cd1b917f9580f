"""What a variation file means, and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from grammars.diagnostics import Diagnostic, Where
from grammars.floorplan import FloorPlan
from grammars.variation._distributions import Distribution
from grammars.variation._expressions import Dimension, Expression, Requirement
from grammars.variation._plan import PlanText, Slot


@dataclass(frozen=True, slots=True)
class Draw:
    """One value to draw; ``unit`` is empty when none was written."""

    name: str
    distribution: Distribution
    unit: str
    where: Where


@dataclass(frozen=True, slots=True)
class Assignment:
    """A slot and where its value comes from: a draw by name, or arithmetic over named draws."""

    slot: Slot
    source: str | Expression
    dimension: Dimension
    where: Where


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """A loaded variation: the plan as text and as geometry, what is drawn and what must hold.

    ``draws`` are in file order, the order they take numbers from a random stream; ``reported``
    names the values of a variant (named draws and attributes) in file order.
    """

    file: str
    plan_file: Path
    plan_text: PlanText
    source: FloorPlan
    draws: tuple[Draw, ...]
    assignments: tuple[Assignment, ...]
    requirements: tuple[Requirement, ...]
    reported: tuple[str, ...]
    warnings: tuple[Diagnostic, ...] = ()

    @property
    def plan_name(self) -> str:
        """The name of the plan that is varied."""
        return self.source.name


@dataclass(frozen=True, slots=True)
class Value:
    """A value of one variant: a named draw, a variable or an attribute; in ``unit`` as written."""

    name: str
    number: float
    unit: str


@dataclass(frozen=True, slots=True)
class Variant:
    """One sampled plan: its text (``.fpm``) and what the text means.

    ``name`` is ``<plan>_<seed>``, also the stem of its file; ``tries`` counts the draws until
    everything required held.
    """

    seed: int
    values: tuple[Value, ...]
    text: str
    name: str
    plan: FloorPlan = field(repr=False, compare=False)
    tries: int = 1
