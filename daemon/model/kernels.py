"""The one way numba kernels are declared, in simulator, stacks, oracles and analysis alike."""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Iterator
from typing import Any, Final, TypeVar, cast

import numpy as np
from numba import njit
from numba.core.registry import CPUDispatcher

F = TypeVar("F", bound=Callable[..., Any])

_CONSTANTS: Final = (bool, int, float, str, bytes, tuple, np.generic)


def kernel(function: F) -> F:
    """Compile to machine code on the first call, cached on disk until a source of it changes."""
    # Never ``parallel``: workers fork from a warm parent, and OpenMP's threads do not survive a
    # fork; cores are for runs. Never ``fastmath``: traces must be equal byte for byte, and
    # reordered sums are not. ``cache`` keeps the machine code next to the source, by its content
    # and the CPU: loading a kernel takes 3 to 10 ms, compiling one 250 to 850 ms.
    compiled: Any = njit(cache=True)(function)
    file = compiled._cache._cache_file
    # numba looks at the file of the kernel alone. What a kernel calls is compiled into it, and so
    # are constants from elsewhere: without them in the stamp an upgraded installation, in whose
    # folders old machine code stays, would run half of the old version.
    used = hashlib.sha256(repr(file._source_stamp).encode())
    for part in _compiled_in(function.__code__, function.__globals__):
        used.update(part.encode())
    file._source_stamp = used.hexdigest()
    return cast(F, compiled)


def _compiled_in(code: types.CodeType, known: dict[str, Any]) -> Iterator[str]:
    """Yield the stamps of the kernels and the values of the constants that ``code`` names."""
    for name, value in _named(code, known):
        if isinstance(value, CPUDispatcher):
            yield f"{name} {cast(Any, value)._cache._cache_file._source_stamp}"
        elif isinstance(value, np.ndarray):
            yield f"{name} {hashlib.sha256(value.tobytes()).hexdigest()}"
        elif isinstance(value, _CONSTANTS):
            yield f"{name} {value!r}"
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _compiled_in(constant, known)


def _named(code: types.CodeType, known: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield what the names in ``code`` stand for in its module, and in modules it names."""
    for name in code.co_names:
        value = known.get(name)
        if isinstance(value, types.ModuleType):
            inside = vars(value)
            yield from ((part, inside[part]) for part in code.co_names if part in inside)
        else:
            yield name, value
