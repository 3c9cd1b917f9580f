"""Finding what a variation names in the plan, or saying what could have been meant."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Final

from grammars.diagnostics import did_you_mean
from grammars.floorplan._source import Findings, Node, with_article
from grammars.variation._plan import Element, PlanText, Slot

_OLD: Final = (
    ("location.transformation.", "location."),
    ("location.pose.", "location."),
    ("pose.", "location."),
    ("wall_", "defaults.wall."),
    ("wall.", "defaults.wall."),
    ("walls.", "defaults.wall."),
)
"""Spellings of older versions of the language, each with today's."""


@dataclass(frozen=True, slots=True)
class Targets:
    """Looks up elements and attributes; what is not there is reported and read as ``None``."""

    plan: PlanText
    findings: Findings
    shared_defaults: bool

    def element(self, path: Node) -> Element | None:
        """Return the element an address such as ``hall`` or ``hall.pillar`` names."""
        address = ".".join(path.parts)
        found = self.plan.elements.get(address, [])
        if len(found) == 1:
            return found[0]
        if found:
            kinds = " and ".join(with_article(e.kind) for e in found)
            message = f'"{address}" is the name of {kinds}'
            self.findings.error(path, message, "rename one of them in the plan")
            return None
        self.findings.error(path, f'the plan has no "{address}"', self._suggest(address))
        return None

    def _suggest(self, address: str) -> str:
        if address in self.plan.variables:
            return f'it is a variable: write "{address}: uniform([…])"'
        if address == self.plan.name:
            return "the plan itself has nothing to vary"
        inside = [name for name in self.plan.elements if name.endswith(f".{address}")]
        if inside:
            return f"write {' or '.join(inside)}: features are addressed by their space"
        return did_you_mean(address, self.plan.elements)

    def variable(self, path: Node) -> Slot | None:
        """Return the variable that a statement such as ``ceiling: uniform(…)`` names."""
        name = ".".join(path.parts)
        slot = self.plan.variables.get(name)
        if slot is not None:
            return slot
        if name in self.plan.elements:
            known = ", ".join(self.plan.elements[name][0].paths())
            hint = f'say what to vary: "{name}: {{ … }}" with {known}'
            self.findings.error(path, f'"{name}" is no variable of the plan', hint)
            return None
        hint = did_you_mean(name, self.plan.variables) or "the plan has no variables"
        self.findings.error(path, f'the plan has no variable "{name}"', hint)
        return None

    def longest(self, path: Node) -> tuple[Element, str] | None:
        """Split ``hall.pillar.height`` into the element and the path in it."""
        words = path.parts
        for count in (1, 2):
            address, rest = ".".join(words[:count]), ".".join(words[count:])
            for element in self.plan.elements.get(address, []):
                is_feature = ".".join(words[: count + 1]) in self.plan.elements
                if rest in element.paths() or not is_feature:
                    return element, rest
        address = ".".join(words[:-1])
        self.findings.error(path, f'the plan has no "{address}"', self._suggest(address))
        return None

    def attribute(
        self, place: Node, element: Element, path: str, more: tuple[str, ...] = ()
    ) -> Slot | None:
        """Return the slot of an attribute; ``more`` are words that could have been meant too."""
        slot = self.plan.slot(element, path, shared_defaults=self.shared_defaults)
        if slot is None:
            label = f'{element.kind} "{element.address}"'
            hint = suggested_path(path, element, more)
            self.findings.error(place, f'{label} has no "{path}"', hint)
        return slot


def suggested_path(path: str, element: Element, more: tuple[str, ...] = ()) -> str:
    """Return ``did you mean …?`` where something is close, and every path there is."""
    known = [*more, *element.paths()]
    meant = _meant(path, known)
    question = f'did you mean "{meant}"? ' if meant else ""
    points = type(element.node.shape).__name__ == "Polygon" and path.startswith("shape")
    note = "; points are varied through variables of the plan" if points else ""
    return f"{question}it has: {', '.join(known)}{note}"


def _meant(path: str, known: list[str]) -> str:
    for old, new in _OLD:
        if path.startswith(old) and new + path.removeprefix(old) in known:
            return new + path.removeprefix(old)
    ending = [name for name in known if name.endswith(f".{path}")]
    if len(ending) == 1:
        return ending[0]
    close = difflib.get_close_matches(path, known, n=1, cutoff=0.6)
    return close[0] if close else ""
