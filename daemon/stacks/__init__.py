"""Systems under test that ship with the project: ``idle``, ``pilot``, ``ros`` and ``ros2``.

A system under test knows only :mod:`daemon.model.sut`, never the simulator.
"""

from __future__ import annotations
