"""The inflated map, worked out once per process for equal maps and parameters."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.navigation.ros.costmap._inflation import Inflation, column_gaps
from daemon.navigation.ros.costmap._layer import LETHAL, UNKNOWN, Cells
from daemon.navigation.ros.costmap._settling import redo
from daemon.navigation.ros.grids import FREE_SPACE
from grammars.grid import OCCUPIED
from grammars.grid import UNKNOWN as UNKNOWN_IN_MAP

_KEPT: Final = 4
_CACHE: OrderedDict[bytes, Prepared] = OrderedDict()


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Flat, read-only: the ``static`` layer, the ``master`` it makes alone, its column ``gaps``."""

    static: Cells
    master: Cells
    gaps: Cells


def static_layer(cells: np.ndarray, unknown: int) -> Cells:
    """Return flat costs of map cells: occupied is lethal, unknown ``unknown``, the rest free."""
    costs = np.zeros(cells.shape, dtype=np.uint8)
    costs[cells == OCCUPIED] = LETHAL
    costs[cells == UNKNOWN_IN_MAP] = unknown
    return costs.ravel()


def prepared(static: Cells, shape: tuple[int, int], default: int, table: Inflation) -> Prepared:
    """Return what the master shows while the obstacle layer is full of ``default``."""
    digest = hashlib.blake2b(static.tobytes(), digest_size=16)
    digest.update(repr((shape, default, table.radius, table.least)).encode())
    digest.update(table.costs.tobytes())
    key = digest.digest()
    if key not in _CACHE:
        _CACHE[key] = _prepare(static, shape, default, table)
        if len(_CACHE) > _KEPT:
            _CACHE.popitem(last=False)
    _CACHE.move_to_end(key)
    return _CACHE[key]


def _prepare(static: Cells, shape: tuple[int, int], default: int, table: Inflation) -> Prepared:
    master, gaps = np.zeros(static.size, np.uint8), np.empty(static.size, np.uint8)
    layer = np.full(static.size, default, dtype=np.uint8)
    whole = np.array([0, 0, shape[1], shape[0]], dtype=np.int32)
    changed = whole.copy()
    redo(master, static, layer, shape, whole, table.costs, table.widths, table.least, changed)
    column_gaps(master, shape, table.radius, gaps)
    for array in (master, gaps):
        array.flags.writeable = False
    return Prepared(static, master, gaps)


def unknown_value(tracked: bool | None) -> int:
    """Return what unknown cells of the map cost: the static layer tracks them unless told not."""
    return FREE_SPACE if tracked is False else UNKNOWN
