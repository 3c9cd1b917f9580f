"""The one way numba kernels are declared, in simulator, stacks, oracles and analysis alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

# Never ``parallel``: workers fork from a warm parent, and OpenMP's threads do not survive a fork;
# cores are for runs. Never ``fastmath``: traces must be equal byte for byte, and reordered sums
# are not. ``cache`` keeps the machine code next to the source, by its time of change and the CPU:
# loading a kernel takes 3 to 10 ms, compiling one 250 to 850 ms.
kernel = cast(Callable[[F], F], njit(cache=True))
"""Compile to machine code on the first call, cached on disk."""
