"""Costs of cells, and the wave that spreads a potential from the robot over them.

The wave is that of ``propNavFnDijkstra`` (blocks of rising priority). GlobalPlanner has the same
wave with other costs (``DijkstraExpansion``, ``QuadraticCalculator``).

A cell passes an improvement on only to neighbours that gain more than 0.7 of their cost. Potentials
therefore depend on the order of the updates, which is the original's.

Arrays are flat with ``SPARE_ROWS`` rows before the first and behind the last one, which are blocked
and never reached. Without an outline GlobalPlanner reads there, outside of its arrays: undefined in
the original, blocked here. Beside the first and the last column it reads the row before or after,
as here.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.cost_grid import INSCRIBED, NO_INFORMATION, Window

SPARE_ROWS: Final = 8
"""Rows enough for all neighbours, even on a map one cell wide."""
NEUTRAL: Final = 50
BLOCKED: Final = 254
"""State of a cell that no wave enters, such as a cell beyond the map."""
PENDING: Final = 256
"""Flag of a waiting cell, stored with its state so that one read gives both."""
DOUBTFUL: Final = 512
"""Flag of a cell that a restricted wave excluded, or that an excluded cell may have changed."""
VALUE: Final = PENDING - 1
"""Mask of the state below the flags."""
UNREACHED: Final = np.float32(1.0e10)
BUFFER: Final = 10_000
"""Capacity of a priority buffer; further cells are lost (navfn ``PRIORITYBUFSIZE``)."""
THRESHOLD_STEP: Final = 100.0

Bytes: TypeAlias = npt.NDArray[np.uint8]
States: TypeAlias = npt.NDArray[np.uint16]


class CellCosts(NamedTuple):
    """State by costmap value and cost by state, both (256,); least gain by state and flags (1024,).

    The wave visits a neighbour again only if it gains more than ``gains``. No gain is enough for a
    cell that is blocked or waits already.
    """

    states: States
    costs: Singles
    gains: Singles


def cell_costs(states: States, costs: Singles, blocked: npt.NDArray[np.bool_]) -> CellCosts:
    """Return the tables for ``costs`` and ``blocked`` flags by state.

    The wave uses costs rounded down to integers, and gains of 0.7 of the exact costs.
    """
    gains = np.full(2 * DOUBTFUL, np.inf, dtype=np.float32)
    exact = np.where(blocked, np.inf, 0.707106781 * costs.astype(np.float64))
    gains[:PENDING] = gains[DOUBTFUL : DOUBTFUL + PENDING] = exact
    return CellCosts(states, np.where(blocked, np.float32(BLOCKED), np.trunc(costs)), gains)


def navfn_costs(*, allow_unknown: bool) -> CellCosts:
    """Return the costs of navfn; the state of a cell is its cost (``setCostmap``)."""
    values = np.arange(PENDING)
    states: States = np.minimum(NEUTRAL + 0.8 * values, BLOCKED - 1).astype(np.uint16)
    states[INSCRIBED:] = BLOCKED
    if allow_unknown:
        states[NO_INFORMATION] = BLOCKED - 1
    return cell_costs(states, values.astype(np.float32), values >= BLOCKED)


class Wave(NamedTuple):
    """A spreading potential: states and potentials of all cells, flat, and their costs.

    ``costs`` and ``gains`` are those of :class:`CellCosts`. ``reached`` lists the cells with a
    potential, for :func:`reset_potentials`; all others are ``UNREACHED``. ``buffers`` (3, size)
    hold the waiting cells.
    """

    states: States
    potentials: Singles
    costs: Singles
    gains: Singles
    reached: Integers
    buffers: Integers
    columns: int


def new_wave(costs: CellCosts, size: int, columns: int, spare: int = 0) -> Wave:
    """Return a wave over blocked cells; ``reached`` has ``spare`` extra entries."""
    return Wave(
        np.full(size, BLOCKED, dtype=np.uint16),
        np.full(size, UNREACHED, dtype=np.float32),
        costs.costs,
        costs.gains,
        np.empty(size + 1 + spare, dtype=np.int32),
        np.empty((3, BUFFER), dtype=np.int32),
        columns,
    )


@kernel
def copy_window(
    cells: Bytes, states: States, by_value: States, border: int, window: Window
) -> bool:
    """Update the states of a window; return whether any changed.

    ``by_value`` has the state of every costmap value. The outermost ``border`` rows and columns of
    the map stay.
    """
    rows, columns = cells.shape
    changed = False
    for row in range(max(window[1], border), min(window[3], rows - border)):
        for column in range(max(window[0], border), min(window[2], columns - border)):
            state = by_value[cells[row, column]]
            n = (SPARE_ROWS + row) * columns + column
            if state != states[n]:
                states[n] = state
                changed = True
    return changed


@kernel
def interpolate_potential(first: np.float32, second: np.float32, cost: np.float32) -> np.float32:
    """Return the potential of a cell from its lowest horizontal and vertical neighbour, float32."""
    lowest, difference = min(first, second), abs(first - second)
    # The constants of the original are doubles: the polynomial is rounded only at its end.
    q = np.float64(difference / cost)
    share = np.float32(-0.2301 * q * q + 0.5307 * q + 0.7040)
    return lowest + cost * (share if difference < cost else np.float32(1.0))


def seed_wave(wave: Wave, seeds: Iterable[tuple[int, float]], around: Iterable[int]) -> int:
    """Give the seeds their potentials, as the first of ``reached``.

    The cells ``around`` that are not blocked wait in the first buffer. Returns their number.
    """
    for count, (cell, potential) in enumerate(seeds):
        wave.potentials[cell] = potential
        wave.reached[count] = cell
    waiting = 0
    for cell in around:
        if wave.gains[wave.states[cell]] < np.inf:
            wave.buffers[0, waiting] = cell
            waiting += 1
            wave.states[cell] |= PENDING
    return waiting


def seed_cell(wave: Wave, cell: int) -> int:
    """Begin a wave at the corner of one cell; return the number of waiting cells."""
    line = wave.columns
    return seed_wave(wave, [(cell, 0.0)], (cell + 1, cell - 1, cell - line, cell + line))


@kernel
def propagate_wave(
    wave: Wave,
    goal: int,
    threshold: np.float32,
    cycles: int,
    limit: np.float32,
    waiting: int,
    count: int,
) -> tuple[int, int, bool]:
    """Spread the wave until ``goal`` has a potential, or the threshold passes ``limit``.

    It begins with the ``waiting`` cells of the first buffer; the first ``count`` cells of
    ``reached`` have a potential already. ``goal`` -1 is never reached. Returns the number of
    reached cells, the fill, and whether no cell waits any more. The fill is the largest number of
    cells that ever waited in one buffer.
    """
    # The original's loop, event for event: its order decides the result, so it stays in one piece.
    states, potentials, reached = wave.states, wave.potentials, wave.reached
    costs, gains, buffers = wave.costs, wave.gains, wave.buffers
    capacity = buffers.shape[1]
    a, b, c = 0, 1, 2
    now, later, over, fill = waiting, 0, 0, 0
    # Unsigned indices need no check for negative values.
    one, line = np.uintp(1), np.uintp(wave.columns)
    for _ in range(cycles):
        if now == 0:
            break
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            states[current[i]] &= PENDING - 1
        for i in range(now):
            n = np.uintp(current[i])
            west, east = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            across = west if west < east else east
            along = up if up < down else down
            # A cell that waits again is pending; its value is below the flag.
            p = interpolate_potential(across, along, costs[states[n] & np.uint16(VALUE)])
            old = potentials[n]
            if p >= old:
                continue
            if old == UNREACHED:
                reached[count] = n
                count += 1
            potentials[n] = p
            soon = p < threshold
            for k in range(4):
                if k == 0:
                    m, potential = n - one, west
                elif k == 1:
                    m, potential = n + one, east
                elif k == 2:
                    m, potential = n - line, up
                else:
                    m, potential = n + line, down
                state = states[m]
                if potential <= p + gains[state]:
                    continue
                if soon:
                    if later < capacity:
                        following[later] = m
                        later += 1
                        states[m] = state | PENDING
                elif over < capacity:
                    postponed[over] = m
                    over += 1
                    states[m] = state | PENDING
        a, b = b, a
        fill = max(fill, later, over)
        now, later = later, 0
        if now == 0:
            threshold += np.float32(THRESHOLD_STEP)
            a, c = c, a
            now, over = over, 0
            if threshold > limit:
                break
        if goal >= 0 and potentials[goal] < UNREACHED:
            break
    for i in range(now):
        states[buffers[a, i]] &= PENDING - 1
    for i in range(over):
        states[buffers[c, i]] &= PENDING - 1
    return count, fill, now == 0


@kernel
def reset_potentials(potentials: Singles, log: Integers, count: int) -> None:
    """Make the first ``count`` cells of ``log`` unreached again."""
    for i in range(count):
        potentials[np.uintp(log[i])] = UNREACHED
