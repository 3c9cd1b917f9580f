"""The systems under test that ship here: ``idle``, ``pilot``, ``ros`` and ``ros2``.

A system under test knows what :mod:`daemon.model.sut` gives it and no more: never the simulator.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from daemon.model.kernel_rooms import SYSTEM_ROOMS


def warm_up(rooms: Iterable[str] = SYSTEM_ROOMS) -> None:
    """Compile or load every kernel of these rooms once, so that forked children need not."""
    for room in rooms:
        import_module(room).warm_up()
