"""Three rings of tests, by folder: ``long/``, any ``parts/``, and the rest, the units.

A unit starts no process and no terminal. A part starts daemons, workers or terminals, and waits for
them: units are tested meanwhile. A file is the work of one process of the tests; a long one begun
last leaves the other processors without work.
"""

from collections import Counter
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
RINGS = {"long": 0.5, "parts": 0.7, "unit": 1.0}
"""Rings, outer ones first, and the share of all files after which the last of theirs begins."""


def ring_of(path):
    """Return the ring of the tests in a file."""
    folders = path.relative_to(TESTS).parent.parts
    return next((ring for ring in RINGS if ring in folders), "unit")


def order_by_ring(items):
    """Mark tests with their rings; put large files first, parts among the units. In place."""
    sizes = Counter(item.path for item in items)
    rings = {path: ring_of(path) for path in sizes}
    for item in items:
        item.add_marker(getattr(pytest.mark, rings[item.path]))
    places = {}
    for ring, until in RINGS.items():
        files = sorted((path for path in sizes if rings[path] == ring), key=lambda p: -sizes[p])
        places |= {path: until * rank / len(files) for rank, path in enumerate(files)}
    items.sort(key=lambda item: (places[item.path], item.path))
