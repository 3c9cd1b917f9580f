"""What may stand at the end of a reference, as the SHACL shapes say, without rdflib."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Final, NamedTuple

from grammars.jsonld._nodes import Node, NodeGraph

REFERENCES_FILE: Final = Path(__file__).with_name("shapes") / "references.json"
"""What the SHACL shapes say about references, in a form that needs no rdflib."""


class ReferenceRule(NamedTuple):
    """What may stand at the end of a reference.

    ``classes`` go by the class of the subject where that matters, else by ``""``. A reference may
    have ``several`` values; the loss of a ``harmless`` one changes nothing that is read.
    """

    classes: dict[str, list[str]]
    several: bool
    harmless: bool

    def allowed(self, node: Node) -> list[str]:
        """Return the classes of what ``node`` may refer to; none: any."""
        *others, default = self.classes
        return self.classes[next((kind for kind in others if kind in node.types), default)]


@functools.cache
def reference_rules() -> dict[str, ReferenceRule]:
    """Return the rule of every predicate that refers to something."""
    rules = json.loads(REFERENCES_FILE.read_text(encoding="utf-8"))
    return {predicate: ReferenceRule(**rule) for predicate, rule in rules.items()}


def dangling(nodes: NodeGraph) -> list[tuple[str, str, str]]:
    """Return references to what is not there: who refers, by which predicate, to what."""
    rules = reference_rules()
    found = []
    for node in nodes.by_id.values():
        for predicate in node.values:
            rule = rules.get(predicate)
            for target in node.refs(predicate) if rule is not None and rule.allowed(node) else ():
                other = nodes.by_id.get(target)
                if other is None or not other.types:
                    found.append((node.id, predicate, str(target)))
    return found
