"""The wave of :mod:`.propagation` without the cells that lead too far away from the goal.

``ahead`` is a potential spread backward from the goal: about what remains from a cell. A cell
whose potential and remainder exceed a bound is not looked at. Afterwards :func:`looks_at_cut`
and :func:`depends_on_cut` follow everything that the path has come from, and find out whether a
cell left out took part in it; the caller then spreads the whole wave instead.
"""

from __future__ import annotations

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.navfn.propagation import (
    BLOCKED,
    PENDING,
    THRESHOLD_STEP,
    UNREACHED,
    Bytes,
    States,
    at_edge,
    interpolate_potential,
)


@kernel
def _queue_if_gaining(
    costs: States,
    gains: Singles,
    m: np.uintp,
    value: np.float32,
    p: np.float32,
    queue: Integers,
    waiting: int,
) -> int:
    """Append a neighbour of potential ``value`` if it gains enough; return how many wait.

    That is hard to foresee: no branches.
    """
    cost = costs[m]
    gaining: bool = value > p + gains[cost]
    queue[np.uintp(waiting)] = m
    costs[m] = cost | (np.uint16(gaining) << np.uint16(8))
    return waiting + gaining


@kernel
def propagate_towards(
    costs: States,
    potentials: Singles,
    gains: Singles,
    ahead: Singles,
    bound: np.float32,
    columns: int,
    start: int,
    goal: int,
    cycles: int,
    buffers: Integers,
    guesses: Singles,
    log: Integers,
    cut: Bytes,
    epoch: int,
) -> tuple[int, int, int, np.float32]:
    """Spread the wave as :func:`propagate` does, but leave out what the bound excludes.

    A cell is left out when threshold plus ``ahead`` exceed ``bound``; ``cut`` is then set to
    ``epoch``. ``log`` takes every cell looked at, in order, and -1 - n for a cell n left out.
    Returns the number of these events, the fill, the cycles used and the threshold at the end.
    It gives up, with a fill of all there is, where a buffer or the log could run over.

    ``guesses`` of shape (3, size) is scratch for what each waiting cell would get at the start of
    a cycle: mostly right, and reckoned without waiting for the cell before, on which the next one
    in line often borders.
    """
    capacity = buffers.shape[1]
    across, along, guess = guesses[0], guesses[1], guesses[2]
    potentials[start] = np.float32(0.0)
    log[0] = start
    events, fill = 1, 0
    a, b, c = 0, 1, 2
    now, later, over = 0, 0, 0
    for cell in (start + 1, start - 1, start - columns, start + columns):
        if 0 <= cell < costs.size and costs[cell] < BLOCKED:
            buffers[a, now] = cell
            now += 1
            costs[cell] |= PENDING
    threshold = np.float32(BLOCKED)
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(columns)
    used = 0
    while used < cycles and now > 0:
        if over + 4 * now > capacity or events + now > log.size:
            fill = capacity
            break
        used += 1
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            n = np.uintp(current[i])
            cost = costs[n] & np.uint16(PENDING - 1)
            costs[n] = cost
            x = min(potentials[n - one], potentials[n + one])
            y = min(potentials[n - line], potentials[n + line])
            across[i], along[i] = x, y
            guess[i] = interpolate_potential(x, y, np.float32(cost))
        farthest = bound - threshold
        for i in range(now):
            n = np.uintp(current[i])
            if ahead[n] > farthest:
                cut[n] = epoch
                log[np.uintp(events)] = -1 - current[i]
                events += 1
                continue
            log[np.uintp(events)] = current[i]
            events += 1
            left, right = potentials[n - one], potentials[n + one]
            up, down = potentials[n - line], potentials[n + line]
            p, x, y = guess[i], min(left, right), min(up, down)
            if x != across[i] or y != along[i]:
                p = interpolate_potential(x, y, np.float32(costs[n] & np.uint16(PENDING - 1)))
            if p >= potentials[n]:
                continue
            potentials[n] = p
            if p < threshold:
                later = _queue_if_gaining(costs, gains, n - one, left, p, following, later)
                later = _queue_if_gaining(costs, gains, n + one, right, p, following, later)
                later = _queue_if_gaining(costs, gains, n - line, up, p, following, later)
                later = _queue_if_gaining(costs, gains, n + line, down, p, following, later)
            else:
                over = _queue_if_gaining(costs, gains, n - one, left, p, postponed, over)
                over = _queue_if_gaining(costs, gains, n + one, right, p, postponed, over)
                over = _queue_if_gaining(costs, gains, n - line, up, p, postponed, over)
                over = _queue_if_gaining(costs, gains, n + line, down, p, postponed, over)
        a, b = b, a
        fill = max(fill, later, over)
        now, later = later, 0
        if now == 0:
            threshold += np.float32(THRESHOLD_STEP)
            a, c = c, a
            now, over = over, 0
        if potentials[goal] < UNREACHED:
            break
    for i in range(now):
        costs[buffers[a, i]] &= PENDING - 1
    for i in range(over):
        costs[buffers[c, i]] &= PENDING - 1
    return events, fill, used, threshold


@kernel
def descent_reads_cut(
    costs: States,
    potentials: Singles,
    ahead: Singles,
    latest: np.float32,
    columns: int,
    cells: Integers,
    length: int,
    cut: Bytes,
    mark: Bytes,
    epoch: int,
) -> bool:
    """Tell whether the descent of a path of ``length`` points looked at a cell left out.

    Neither may a cell it found unreached be one that could have been reached in time: ``latest``
    is the largest remainder with which a wave through the cells left out comes too late. ``mark``
    is set to ``epoch`` where the descent looked.
    """
    for i in range(length):
        # At the edge of the wave the descent compares eight neighbours; elsewhere it takes the
        # gradients of four cells, which look one further.
        at = cells[i]
        seen = i > 0 and at == cells[i - 1]
        if seen or at <= columns or at >= potentials.size - columns - 1:
            continue
        beyond = 2 if at_edge(potentials, at, columns) else 3
        for r in range(-1, beyond):
            for n in range(at + r * columns - 1, at + r * columns + beyond):
                if n >= potentials.size or mark[n] == epoch:
                    continue
                if cut[n] == epoch:
                    return True
                mark[n] = epoch
                missing = potentials[n] >= UNREACHED and costs[n] < BLOCKED
                if missing and latest < ahead[n] < UNREACHED:
                    return True
    return False


@kernel
def history_reads_cut(columns: int, log: Integers, events: int, mark: Bytes, epoch: int) -> bool:
    """Tell whether a cell left out took part in what the marked cells have gone through.

    Backward through the log: a cell that is needed when it was looked at needs its neighbours
    from then on back, because nothing else can have told it a potential or made it be looked at.
    A cell left out before it was needed for the last time is one too many. ``mark`` is
    ``epoch`` for needed cells and becomes one more when their neighbours are marked.
    """
    one, line = np.uintp(1), np.uintp(columns)
    # The first is the start, which needs nobody and may lie on the border.
    for event in range(events - 1, 0, -1):
        entry = log[event]
        if entry < 0:
            if mark[np.uintp(-1 - entry)] >= epoch:
                return True
            continue
        n = np.uintp(entry)
        if mark[n] == epoch:
            mark[n] = epoch + 1
            mark[n - one] = max(mark[n - one], epoch)
            mark[n + one] = max(mark[n + one], epoch)
            mark[n - line] = max(mark[n - line], epoch)
            mark[n + line] = max(mark[n + line], epoch)
    return False
