"""The wave of :mod:`.expansion` without the cells that lead too far away from the goal.

As in :mod:`daemon.stacks.ros1.navfn.restricted`, whose remainder guides it and whose checks find
out whether a cell left out took part in the path.
"""

from __future__ import annotations

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Integers, Singles
from daemon.stacks.ros1.global_planner.expansion import (
    AROUND_GOAL,
    THRESHOLD_STEP,
    VALUE,
    Bytes,
    States,
)
from daemon.stacks.ros1.navfn.propagation import BLOCKED, UNREACHED, interpolate_potential
from daemon.stacks.ros1.navfn.restricted import queue_if_gaining


@kernel
def propagate_towards(
    states: States,
    potentials: Singles,
    costs: Singles,
    gains: Singles,
    ahead: Singles,
    bound: np.float32,
    lethal: int,
    columns: int,
    goal: int,
    cycles: int,
    buffers: Integers,
    waiting: int,
    guesses: Singles,
    log: Integers,
    events: int,
    cut: Bytes,
    epoch: int,
) -> tuple[int, int, int, np.float32]:
    """Spread the quadratic wave, but leave out what the bound excludes; no cost may be 0.

    A cell is left out when threshold plus ``ahead`` exceed ``bound``; ``cut`` is then set to
    ``epoch``. ``log`` has ``events`` entries already and takes every cell looked at, in order, and
    -1 - n for a cell n left out. Returns the number of entries, the fill, the cycles used and
    the threshold at the end. It gives up, with a fill of all there is, where a buffer or the log
    could run over, or where the wave would start in an area that has no way to the goal: the
    four cells at the start may lie between several, and the checks know of one. ``guesses``
    (3, size) is scratch.
    """
    capacity = buffers.shape[1]
    across, along, guess = guesses[0], guesses[1], guesses[2]
    a, b, c = 0, 1, 2
    now, later, over, fill = waiting, 0, 0, 0
    threshold = np.float32(lethal)
    # Unsigned, so that an index is not looked at for being negative.
    one, line = np.uintp(1), np.uintp(columns)
    used = 0
    for i in range(waiting):
        if ahead[buffers[a, i]] >= UNREACHED:
            fill, cycles = capacity, 0
    # One loop with everything in registers: the order of its events is the result.
    while used < cycles and now > 0:
        if over + 4 * now > capacity or events + now > log.size - AROUND_GOAL:
            fill = capacity
            break
        used += 1
        current, following, postponed = buffers[a], buffers[b], buffers[c]
        for i in range(now):
            n = np.uintp(current[i])
            state = states[n] & np.uint16(VALUE)
            states[n] = state
            x = min(potentials[n - one], potentials[n + one])
            y = min(potentials[n - line], potentials[n + line])
            across[i], along[i] = x, y
            guess[i] = interpolate_potential(x, y, costs[state])
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
                p = interpolate_potential(x, y, costs[states[n] & np.uint16(VALUE)])
            if p >= potentials[n]:
                continue
            potentials[n] = p
            if p < threshold:
                later = queue_if_gaining(states, gains, n - one, left, p, following, later)
                later = queue_if_gaining(states, gains, n + one, right, p, following, later)
                later = queue_if_gaining(states, gains, n - line, up, p, following, later)
                later = queue_if_gaining(states, gains, n + line, down, p, following, later)
            else:
                over = queue_if_gaining(states, gains, n - one, left, p, postponed, over)
                over = queue_if_gaining(states, gains, n + one, right, p, postponed, over)
                over = queue_if_gaining(states, gains, n - line, up, p, postponed, over)
                over = queue_if_gaining(states, gains, n + line, down, p, postponed, over)
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
        states[buffers[a, i]] &= VALUE
    for i in range(over):
        states[buffers[c, i]] &= VALUE
    return events, fill, used, threshold


@kernel
def goal_reads_cut(
    costs: States,
    potentials: Singles,
    ahead: Singles,
    latest: np.float32,
    columns: int,
    goal: int,
    cut: Bytes,
    mark: Bytes,
    epoch: int,
) -> bool:
    """Tell whether what the potentials around the goal are filled from was left out.

    Neither may a cell there that was not reached be one that a wave through the cells left out
    could have reached: its remainder is above ``latest``. ``mark`` is set to ``epoch`` there.
    """
    for row in range(-3, 4):
        for n in range(goal + row * columns - 3, goal + row * columns + 4):
            if cut[n] == epoch:
                return True
            mark[n] = epoch
            missing = potentials[n] >= UNREACHED and costs[n] < BLOCKED
            if missing and latest < ahead[n] < UNREACHED:
                return True
    return False
