"""What a dead worker left in the spool, and who may take it over."""

from contextlib import closing
from dataclasses import replace

import pytest

from daemon.batch.paths import StatePaths
from daemon.batch.run_process import LEASE, RESULT
from daemon.batch.worker import AdoptedWork, Spool
from daemon.model.messages import Lease
from tests.daemon.batch.samples import make_spec


@pytest.fixture
def places(tmp_path):
    paths = StatePaths(tmp_path)
    paths.make_folders()
    return paths


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
            assert heir.adopt() == AdoptedWork()
            living.open(lease(2)).discard()
        leave(places)
        adopted = heir.adopt()
        assert adopted.unfinished == (lease(1),)
        assert [(found.lease, found.finished) for found in adopted.finished] == [(lease(0), True)]
        assert [path.name for path in places.spool.iterdir()] == ["heir"]
        assert heir.adopt() == AdoptedWork()


def test_attempts_of_a_run_that_was_deleted_and_submitted_again_keep_apart(places):
    with closing(Spool(places, "one")) as spool:
        before, again = spool.open(lease(0)), spool.open(replace(lease(0), token=9))
        before.discard()
        assert (again.folder / LEASE).exists()
        again.discard()
        assert not again.folder.parent.exists()
