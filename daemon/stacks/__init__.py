"""The systems under test that ship here: ``idle``, ``pilot``, ``ros`` and ``ros2``.

A system under test knows what :mod:`daemon.model.sut` gives it and no more: never the simulator.
"""

from __future__ import annotations
