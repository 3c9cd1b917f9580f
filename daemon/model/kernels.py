"""The one way numba kernels are declared, in simulator, stacks, oracles and analysis alike.

And what happens when machine code for one is not on the disk yet: it is compiled at once, or not at
all (:func:`loading_only`).
"""

from __future__ import annotations

import gc
import hashlib
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numpy as np
from numba import njit
from numba.core import event
from numba.core.registry import CPUDispatcher

F = TypeVar("F", bound=Callable[..., Any])

_CONSTANTS: Final = (bool, int, float, str, bytes, tuple, np.generic)
_COMPILING: Final = "numba:compile"
"""The event around compiling one function; there is none when machine code is loaded."""
_COLLECT_RARELY: Final = 50_000
"""Objects made between two collections while numba compiles."""


class NotCompiledError(Exception):
    """There is no machine code on the disk for a kernel that was called."""


def kernel(function: F) -> F:
    """Compile to machine code on the first call, cached on disk until a source of it changes."""
    # Never ``parallel``: workers fork from a warm parent, and OpenMP's threads do not survive a
    # fork; cores are for runs. Never ``fastmath``: traces must be equal byte for byte, and
    # reordered sums are not. ``cache`` keeps the machine code next to the source, by its content
    # and the CPU: loading a kernel takes 3 to 10 ms, compiling one 250 to 850 ms.
    # The wrapper by which C would call a kernel is left out: nobody does, and it takes about 4 %
    # of the time of compiling. (The option is missing in numba's annotations.)
    compiled: Any = cast(Any, njit)(cache=True, no_cfunc_wrapper=True)(function)
    file = compiled._cache._cache_file
    # numba looks at the file of the kernel alone, at its size and time. What a kernel calls is
    # compiled into it, and so are constants from elsewhere: without them in the stamp an upgraded
    # installation, in whose folders old machine code stays, would run half of the old version. The
    # time is left out: a copy, or an image of a container, has the same source and another time.
    used = hashlib.sha256(_content(function.__code__.co_filename).encode())
    for part in _compiled_in(function.__code__, function.__globals__):
        used.update(part.encode())
    file._source_stamp = used.hexdigest()
    return cast(F, compiled)


@cache
def _content(file: str) -> str:
    """Return the digest of a source file."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


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


class _Listener(event.Listener):
    """Calls ``began`` when the compilation of a function begins, ``ended`` when it has ended."""

    def __init__(self, began: Callable[[Any], None], ended: Callable[[Any], None]) -> None:
        self._began, self._ended = began, ended

    def on_start(self, happened: Any) -> None:
        """Take a beginning."""
        self._began(happened.data["dispatcher"])

    def on_end(self, happened: Any) -> None:
        """Take an end."""
        self._ended(happened.data["dispatcher"])


def _ignore(_: Any) -> None:
    """Do nothing about a beginning or an end."""


@contextmanager
def loading_only() -> Iterator[None]:
    """Compile nothing meanwhile: raises :class:`NotCompiledError` where that would be needed."""

    def refuse(dispatcher: Any) -> None:
        raise NotCompiledError(f"{dispatcher.__module__}.{dispatcher.__name__}")

    with event.install_listener(_COMPILING, _Listener(refuse, _ignore)):
        yield


class _RareCollections:
    """Lets the garbage collector alone while something is compiled.

    numba makes millions of small objects that live until a function is done. With Python's
    thresholds a quarter of the time went into walking through them; with these a process is 10 MB
    larger at the end.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._before = gc.get_threshold()

    def begin(self, _: Any) -> None:
        """Set the thresholds with the outermost function: one compiles those that it calls."""
        if self._depth == 0:
            self._before = gc.get_threshold()
            gc.set_threshold(max(_COLLECT_RARELY, self._before[0]), *self._before[1:])
        self._depth += 1

    def end(self, _: Any) -> None:
        """Set them back."""
        self._depth -= 1
        if self._depth == 0:
            gc.set_threshold(*self._before)


_collections: Final = _RareCollections()
event.register(  # type: ignore[no-untyped-call]
    _COMPILING, _Listener(_collections.begin, _collections.end)
)
