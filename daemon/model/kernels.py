"""The one way numba kernels are declared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

kernel = cast(Callable[[F], F], njit(cache=True))
"""Compile to machine code on the first call, cached on disk. Never parallel: workers fork."""
