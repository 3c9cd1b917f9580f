"""Three rings of tests, by folder: ``long/``, any ``parts/``, and the rest, the units.

A unit starts no process and no terminal. A part starts daemons, workers or terminals. What takes
longest is begun first: a file is the work of one process of the tests, and begun last it leaves
the other processors without work.
"""

from collections import Counter
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
RINGS = ("long", "parts", "unit")


def ring_of(path):
    """Return the ring of the tests in a file."""
    folders = path.relative_to(TESTS).parent.parts
    return next((ring for ring in RINGS if ring in folders), "unit")


def order_by_ring(items):
    """Mark tests with their rings; put outer rings first, then large files. In place."""
    sizes = Counter(item.path for item in items)
    rings = {path: ring_of(path) for path in sizes}
    for item in items:
        item.add_marker(getattr(pytest.mark, rings[item.path]))
    items.sort(key=lambda item: (RINGS.index(rings[item.path]), -sizes[item.path]))
