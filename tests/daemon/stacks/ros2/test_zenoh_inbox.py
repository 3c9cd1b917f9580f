"""Which command answers a cycle, and what is kept until somebody asks."""

import struct
from threading import Thread

import pytest

from daemon.stacks.ros2.rmw_zenoh.inbox import Inbox

STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
SECOND = 1_000_000_000
PATIENCE = 60.0


def command(time, *, big=False):
    head = b"\x00\x00\x00\x00" if big else b"\x00\x01\x00\x00"
    return head + struct.pack(">iI" if big else "<iI", *divmod(time, SECOND)) + bytes(60)


def nothing():
    raise AssertionError("nothing came that has to be looked after")


@pytest.mark.parametrize(("tolerance", "answers"), [(0, False), (9, False), (10, True)])
def test_a_stamp_may_be_older_by_the_tolerance(tolerance, answers):
    inbox = Inbox()
    inbox.expect(5 * SECOND - tolerance)
    inbox.put_command("/cmd_vel", STAMPED, command(5 * SECOND - 10))
    inbox.wait(0.0, for_command=True, attend=nothing)
    assert (inbox.latency() is not None) == answers
    assert inbox.take().commands == 1


@pytest.mark.parametrize("big", [False, True])
def test_waiting_ends_with_the_answer(big):
    inbox = Inbox()
    inbox.expect(5 * SECOND)

    def answer():
        inbox.put_command("/cmd_vel", STAMPED, command(4 * SECOND, big=big))
        inbox.put_command("/cmd_vel", STAMPED, command(5 * SECOND, big=big))

    thread = Thread(target=answer)
    thread.start()
    inbox.wait(PATIENCE, for_command=True, attend=nothing)
    thread.join()
    latency = inbox.latency()
    assert latency is not None
    assert 0.0 <= latency < PATIENCE
    taken = inbox.take()
    assert taken.commands == 2
    assert [message.data for message in taken.messages] == [command(5 * SECOND, big=big)]


def test_a_command_without_stamp_from_before_the_clock_is_no_answer():
    inbox = Inbox()
    inbox.put_command("/cmd_vel", PLAIN, bytes(52))
    inbox.expect(SECOND)
    inbox.wait(0.0, for_command=True, attend=nothing)
    assert inbox.latency() is None
    inbox.put_command("/cmd_vel", PLAIN, bytes(52))
    assert inbox.latency() is not None


@pytest.mark.parametrize("data", [b"", bytes(11)])
def test_damaged_commands_are_no_answer(data):
    inbox = Inbox()
    inbox.expect(0)
    inbox.put_command("/cmd_vel", STAMPED, data)
    assert inbox.latency() is None


def test_the_last_of_a_topic_or_all_oldest_first():
    inbox = Inbox()
    assert not inbox.take().heard
    for number in range(3):
        inbox.put("/rosout", "a/msg/B", True, bytes([number]))
        inbox.put("/plan", "a/msg/C", False, bytes([number]))
    taken = inbox.take()
    assert [(one.topic, one.data[0]) for one in taken.messages] == [
        ("/rosout", 0),
        ("/rosout", 1),
        ("/rosout", 2),
        ("/plan", 2),
    ]
    assert taken.heard
    assert inbox.take().messages == ()


def test_a_flood_is_bounded():
    inbox = Inbox()
    for number in range(5000):
        inbox.put("/rosout", "a/msg/B", True, number.to_bytes(4, "little"))
    messages = inbox.take().messages
    assert len(messages) == 1000
    assert messages[-1].data == (4999).to_bytes(4, "little")


def test_news_are_looked_after_while_waiting():
    inbox = Inbox()
    inbox.expect(0)
    seen = []

    def attend():
        seen.append(True)
        inbox.put_command("/cmd_vel", STAMPED, command(0))
        return False

    inbox.wake(heard=False)
    inbox.wait(PATIENCE, for_command=True, attend=attend)
    assert seen == [True]
    assert inbox.take().heard


def test_no_command_is_owed_when_a_goal_has_ended():
    inbox = Inbox()
    inbox.expect(0)
    inbox.wake(heard=True)
    inbox.wait(PATIENCE, for_command=True, attend=lambda: True)
    assert inbox.latency() is None
