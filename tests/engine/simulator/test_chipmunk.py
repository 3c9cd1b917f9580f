"""Chipmunk's own functions are what pymunk's public properties and steps are, in worlds too.

A failure after a new pymunk means that it keeps the functions elsewhere, or that they mean
something else: ``pymunk/body.py`` calls them.
"""

import numpy as np
import pymunk
from hypothesis import given
from hypothesis import strategies as st
from pymunk.batch import Buffer, get_space_bodies

from daemon.simulator import _chipmunk as chipmunk
from daemon.simulator._physics import DT
from tests.engine.simulator.test_determinism import digest

numbers = st.floats(-1e6, 1e6)


@given(numbers, numbers, numbers, numbers, numbers, numbers)
def test_reading_and_writing_is_that_of_the_properties(x, y, yaw, vx, vy, spin):
    body, public = pymunk.Body(2.0, 3.0), pymunk.Body(2.0, 3.0)
    space, other = pymunk.Space(), pymunk.Space()
    for each, home in ((body, space), (public, other)):
        home.add(each)
        each.position, each.angle = (x, y), yaw
    handle = chipmunk.handle(body)
    chipmunk.set_velocity(handle, (vx, vy))
    chipmunk.set_angular_velocity(handle, spin)
    chipmunk.stepper(space)()
    public.velocity, public.angular_velocity = (vx, vy), spin
    other.step(DT)
    position, velocity = chipmunk.position(handle), chipmunk.velocity(handle)
    state = (position.x, position.y, chipmunk.angle(handle))
    state += (velocity.x, velocity.y, chipmunk.angular_velocity(handle))
    assert state == (*public.position, public.angle, *public.velocity, public.angular_velocity)
    # Read again after a body more, for which Chipmunk's arrays have to grow.
    read = chipmunk.body_reader(space)
    for _ in range(2):
        ids, rows = read()
        buffer = Buffer()
        get_space_bodies(space, chipmunk._FIELDS, buffer)
        assert ids == bytes(buffer.int_buf())
        assert rows.tobytes() == bytes(buffer.float_buf())
        row = np.frombuffer(ids, dtype=np.uintp).tolist().index(body.id)
        assert tuple(rows[row].tolist()) == state
        space.add(*(pymunk.Body(1.0, 1.0) for _ in range(20)))


def test_a_sleeping_body_is_seen_to_sleep_and_woken_by_writing():
    space, body = pymunk.Space(), pymunk.Body(1.0, 1.0)
    space.sleep_time_threshold = 0.1
    space.add(body)
    handle, step = chipmunk.handle(body), chipmunk.stepper(space)
    assert not chipmunk.is_sleeping(handle)
    for _ in range(20):
        step()
    assert chipmunk.is_sleeping(handle)
    chipmunk.set_velocity(handle, (0.0, 1.0))
    assert not chipmunk.is_sleeping(handle)


def test_a_world_is_the_same_by_the_steps_of_pymunk(monkeypatch):
    """With doors, contacts, triggers and jumps: callbacks reach Python in either kind of step."""
    direct = digest(5)
    monkeypatch.setattr(chipmunk, "stepper", lambda space: lambda: space.step(DT))
    assert digest(5) == direct
