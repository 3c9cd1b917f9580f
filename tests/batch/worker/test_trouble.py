"""Pauses of a worker after trouble, and its questions in the background."""

import time

import pytest

from daemon.batch.worker._trouble import WorkerTrouble
from daemon.batch.worker._wakeups import BackgroundAsks


def test_pauses_double_until_a_success(monkeypatch):
    now = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    trouble, whole = WorkerTrouble(print, int), 1.0
    for _ in range(12):
        trouble.note("the disk is full")
        assert 0.75 * whole <= trouble.until - now <= 1.25 * whole
        until = trouble.until
        trouble.note("the disk is full")  # of what had begun before the pause
        assert trouble.until == until
        now, whole = until, min(2.0 * whole, 60.0)
    trouble.clear()
    assert (trouble.words, trouble.until) == ("", 0.0)
    trouble.note("no process")
    assert trouble.until - now <= 1.25


def test_answers_are_taken_once_and_wake_the_loop():
    asks = BackgroundAsks()
    asks.start("one", lambda: 1)
    asks.start("two", lambda: 1 // 0)
    assert ("one" in asks, len(asks)) == (True, 2)
    asks.wait()
    (_, good), (_, bad) = asks.take()
    assert good.result() == 1
    with pytest.raises(ZeroDivisionError):
        bad.result()
    assert (asks.take(), len(asks)) == ([], 0)
    asks.close()
