"""SHACL: our shapes over a composed graph, results as diagnostics."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rdflib import Graph, URIRef

from grammars.diagnostics import Diagnostic, Severity, Where
from grammars.metamodel._vocabulary import local_name

_FOLDER: Final = Path(__file__).with_name("shapes")
_SH: Final = "http://www.w3.org/ns/shacl#"


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
    results = [_result(report, node, places) for node in report.subjects(_sh("focusNode"), None)]
    return tuple(d for _, d in sorted(results, key=lambda pair: pair[0]))


def _result(
    report: Any, node: Any, places: Mapping[str, Where]
) -> tuple[tuple[str, str], Diagnostic]:
    focus = str(report.value(node, _sh("focusNode")))
    message = str(report.value(node, _sh("resultMessage")) or "does not fit its shape")
    value = report.value(node, _sh("value"))
    found = f", found {local_name(str(value))}" if value is not None and str(value) != focus else ""
    warning = report.value(node, _sh("resultSeverity")) == _sh("Warning")
    return (focus, message), Diagnostic(
        places.get(focus) or Where(f"<{focus}>"),
        f"{local_name(focus)}: {message}{found}",
        "",
        Severity.WARNING if warning else Severity.ERROR,
    )


def _sh(term: str) -> URIRef:
    return URIRef(_SH + term)
