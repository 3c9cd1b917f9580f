"""What a dead worker left in the spool, and who may take it over."""

import os
import shutil
from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace

import pytest

from daemon.batch.doctor import check_leftovers
from daemon.batch.run_process import LEASE, RESULT
from daemon.batch.worker import _attempts
from daemon.batch.worker._attempts import Spool
from daemon.model.messages import Lease
from tests.make import make_spec


def lease(position):
    return Lease(f"c.{position}", "c", 1, 7 + position, f"c/{position}.mcap", make_spec(position))


def leave(places):
    """A worker that dies with two attempts, the first of them finished."""
    with closing(Spool(places, "dead")) as spool:
        (spool.open(lease(0)).folder / RESULT).touch()
        spool.open(lease(1))


def test_finished_attempts_and_all_other_leases_are_adopted_once(places):
    with closing(Spool(places, "heir")) as heir:
        with closing(Spool(places, "living")) as living:
            living.open(lease(2))
            assert heir.adopt() == ([], [])
            living.discard(living.open(lease(2)))
        leave(places)
        finished, unfinished = heir.adopt()
        assert unfinished == [lease(1)]
        assert [(found.lease, found.finished) for found in finished] == [(lease(0), True)]
        assert [path.name for path in places.spool.iterdir()] == ["heir"]
        assert heir.adopt() == ([], [])


def test_attempts_of_a_run_that_was_deleted_and_submitted_again_keep_apart(places):
    with closing(Spool(places, "one")) as spool:
        before, again = spool.open(lease(0)), spool.open(replace(lease(0), token=9))
        spool.discard(before)
        assert (again.folder / LEASE).exists()
        spool.discard(again)
        assert not again.folder.parent.exists()


@pytest.fixture
def immutable(monkeypatch):
    """Folders cannot be removed, as if a file in them were somebody else's."""

    def refuse(folder, *_, **__):
        raise PermissionError(1, "Operation not permitted", str(folder))

    monkeypatch.setattr(shutil, "rmtree", refuse)


def put_link(folder):
    shutil.rmtree(folder)
    folder.symlink_to("/")


def put_pipe(folder):
    (folder / LEASE).unlink()
    os.mkfifo(folder / LEASE)


def put_loop(folder):
    (folder / RESULT).symlink_to(RESULT)


@pytest.mark.parametrize("spoil", [put_link, put_pipe, put_loop])
def test_whatever_lies_in_an_attempts_place_stops_neither_its_worker_nor_the_next(places, spoil):
    with closing(Spool(places, "one")) as spool:
        attempt = spool.open(lease(0))
        spoil(attempt.folder)
        spool.discard(attempt)
        assert not os.path.lexists(attempt.folder)
        spoil(spool.open(lease(1)).folder)
    with closing(Spool(places, "heir")) as heir:
        assert heir.adopt()[0] == []
        assert [path.name for path in places.spool.iterdir()] == ["heir"]


def test_a_folder_that_cannot_be_removed_is_put_aside_and_named_by_the_doctor(
    places, immutable, capsys
):
    with closing(Spool(places, "one")) as spool:
        attempt = spool.open(lease(0))
        spool.discard(attempt)
        assert not attempt.folder.parent.exists()
    assert "Operation not permitted" in capsys.readouterr().err
    messages = [finding.message for finding in check_leftovers(places, 0.0)]
    assert any("moved aside, damaged or not removable, 1:" in one for one in messages)


def test_what_cannot_be_taken_over_is_tried_less_and_less_often(places, monkeypatch, immutable):
    now = SimpleNamespace(time=1000.0)
    monkeypatch.setattr(_attempts, "time", SimpleNamespace(monotonic=lambda: now.time))
    leave(places)
    places.aside.write_text("no folder")
    with closing(Spool(places, "heir")) as heir:
        looks = []
        for _ in range(600):
            now.time += 1.0
            if heir.adopt()[1]:
                looks.append(now.time)
        assert 5 <= len(looks) <= 12
        places.aside.unlink()
        now.time += 1000.0
        heir.adopt()
        assert [path.name for path in places.spool.iterdir()] == ["heir"]
