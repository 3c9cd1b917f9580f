"""Chipmunk's own functions are what pymunk's public properties and steps are, in worlds too."""

import sys
from types import SimpleNamespace

import numpy as np
import pymunk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.simulator import _chipmunk
from tests.daemon.simulator.test_determinism import digest

numbers = st.floats(-1e6, 1e6)
DIRECT = _chipmunk.find_direct()


def test_the_pymunk_that_is_installed_has_the_functions():
    """Fails when a new pymunk has moved them: runs then take a tenth longer, and nothing else.

    What to do: find the functions of ``_chipmunk.BodyFunctions`` in the new version
    (``pymunk/body.py`` calls them) and let ``find_direct`` look there as well.
    """
    assert DIRECT is not None
    assert _chipmunk.position is DIRECT.position


@given(numbers, numbers, numbers, numbers, numbers, numbers)
def test_reading_and_writing_is_that_of_the_properties(x, y, yaw, vx, vy, spin):
    assert DIRECT is not None
    bodies = [pymunk.Body(2.0, 3.0), pymunk.Body(2.0, 3.0)]
    spaces = [pymunk.Space(), pymunk.Space()]
    found = []
    for body, space, use in zip(bodies, spaces, (DIRECT, _chipmunk.PUBLIC), strict=True):
        space.add(body)
        body.position, body.angle = (x, y), yaw
        handle = use.handle(body)
        use.set_velocity(handle, (vx, vy))
        use.set_angular_velocity(handle, spin)
        use.step(space)()
        position, velocity = use.position(handle), use.velocity(handle)
        found.append((position.x, position.y, velocity.x, velocity.y))
        found[-1] += (use.angle(handle), use.angular_velocity(handle))
        assert not use.is_sleeping(handle)
        # Read again after a body more, for which Chipmunk's arrays have to grow.
        read = use.reader(space)
        for _ in range(2):
            ids, rows = read()
            row = rows[np.frombuffer(ids, dtype=np.uintp).tolist().index(body.id)].tolist()
            assert row == [*body.position, body.angle, vx, vy, spin]
            assert len(rows) == len(ids) // np.uintp(0).nbytes
            space.add(*(pymunk.Body(1.0, 1.0) for _ in range(20)))
    assert found[0] == found[1]
    assert found[0] == (*bodies[0].position, *bodies[0].velocity, bodies[0].angle, spin)


def test_a_sleeping_body_is_seen_to_sleep_and_woken_by_writing():
    assert DIRECT is not None
    for use in (DIRECT, _chipmunk.PUBLIC):
        space, body = pymunk.Space(), pymunk.Body(1.0, 1.0)
        space.sleep_time_threshold = 0.1
        space.add(body)
        handle, step = use.handle(body), use.step(space)
        for _ in range(20):
            step()
        assert use.is_sleeping(handle)
        use.set_velocity(handle, (0.0, 1.0))
        assert not use.is_sleeping(handle)


def test_a_world_is_the_same_by_pymunk_alone(monkeypatch):
    """With doors, contacts, triggers and jumps: callbacks reach Python in either kind of step."""
    direct = digest(5)
    names = _chipmunk.BodyFunctions._fields
    for name, function in zip(names, _chipmunk.PUBLIC, strict=True):
        name = {"step": "stepper", "reader": "body_reader"}.get(name, name)
        monkeypatch.setattr(_chipmunk, name, function)
    assert digest(5) == direct


@pytest.mark.parametrize("lib", [None, SimpleNamespace(cpSpaceStep=print)])
def test_a_pymunk_that_keeps_them_elsewhere_is_used_by_its_properties(monkeypatch, lib):
    module = None if lib is None else SimpleNamespace(lib=lib)
    monkeypatch.setitem(sys.modules, "pymunk._chipmunk_cffi", module)
    assert _chipmunk.find_direct() is None
