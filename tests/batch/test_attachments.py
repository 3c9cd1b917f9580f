"""Files a plugged-in system under test needs: by digest from the SUT file to the run's process."""

from __future__ import annotations

import hashlib
import random
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from daemon.batch.errors import Refused
from daemon.batch.paths import StatePaths
from daemon.batch.server._inputs import InputStore
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._submissions import admit_submission
from daemon.batch.server._uploads import Uploads
from daemon.batch.worker._connection import InputCache, WorkerPaths
from daemon.campaign import LayerLibrary
from daemon.model import attachments
from daemon.model.attachments import (
    SutMissing,
    attach_files,
    user_files_folder,
)
from daemon.model.messages import FilePart, PutRequest
from daemon.model.spec import SutReference
from daemon.stacks import registry
from daemon.stacks.registry import make_sut
from grammars.text import codec
from grammars.text.diagnostics import InputError
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished, worker_for

MODEL = random.Random(3).randbytes(1_500_000)
DIGEST = hashlib.sha256(MODEL).hexdigest()


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "policy.onnx").write_bytes(MODEL)
    return tmp_path


@dataclass
class Stack:
    """What a plug-in makes."""

    period: float = 0.1
    needs_ground_truth: bool = False

    def start(self, _): ...
    def update(self, _): ...


@pytest.fixture
def plugged(monkeypatch):
    """The kind ``learned``, and the parameters it was made of."""
    seen = []

    class Entry:
        name = "learned"
        dist = None
        value = "learned:make"

        def load(self):
            return lambda parameters: seen.append(parameters) or Stack()

    monkeypatch.setattr(registry, "installed", lambda group: {"learned": Entry()})
    return seen


def sut_file(folder, text):
    path = folder / "mine.sut.yaml"
    path.write_text(text)
    return path


def test_a_sut_file_names_files_and_the_specification_their_digests(here, plugged):
    text = "sut: mine\nkind: learned\nfiles:\n  model: policy.onnx\nparameters:\n  speed: 0.5\n"
    sut = LayerLibrary(here).sut_file(sut_file(here, text))
    assert sut.reference == SutReference("mine", "learned", {"speed": 0.5}, {"model": DIGEST})
    # What was checked in another process is made here, as a run makes it.
    make_sut("learned", sut.reference.local_parameters)
    parameters = plugged[-1]
    assert parameters["speed"] == 0.5
    model = Path(parameters["files"]["model"])
    assert model.read_bytes() == MODEL
    assert model.stat().st_mode & 0o222 == 0  # for reading only


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("kind: learned\nfiles:\n  model: gone.onnx\n", "no file .*gone.onnx"),
        ("kind: learned\nfiles:\n  model: [policy.onnx, policy.onnx]\n", "one file, not several"),
        ("kind: learned\nfiles:\n  ../model: policy.onnx\n", "is no name"),
        ("kind: pilot\nfiles:\n  model: policy.onnx\n", "pilot needs none"),
    ],
)
def test_what_is_wrong_with_files_stands_where_it_was_written(here, plugged, text, complaint):
    with pytest.raises(InputError, match=complaint):
        LayerLibrary(here).sut_file(sut_file(here, "sut: mine\n" + text))


def test_files_are_bounded(here, monkeypatch):
    monkeypatch.setattr(attachments, "LARGEST_FILE", 2**20)
    with pytest.raises(ValueError, match="at most 1 may have"):
        attach_files({"model": here / "policy.onnx"})
    with pytest.raises(ValueError, match="model is no ordinary file"):
        attach_files({"model": Path("/dev/zero")})
    with pytest.raises(ValueError, match="17 are too many"):
        attach_files({f"f{i}": here / "policy.onnx" for i in range(17)})


def test_a_parameter_of_that_name_is_left_alone():
    parameters = {"files": {"a": "b"}}
    assert SutReference("mine", "learned", parameters).local_parameters == parameters


def test_what_is_no_digest_never_becomes_a_path():
    for digest in ("../../etc/passwd", "0" * 63, "0" * 64 + "\n"):
        sut = SutReference("mine", "learned", {}, {"a": digest})
        with pytest.raises(ValueError, match="pattern"):
            codec.from_json(SutReference, codec.to_json(sut))


def test_a_file_that_is_not_here_is_nothing_to_blame_a_run_for(here):
    sut = SutReference("mine", "learned", {}, {"model": "0" * 64})
    with pytest.raises(SutMissing, match='the file "model" of the system under test is not here'):
        _ = sut.local_parameters


@pytest.fixture
def places(tmp_path):
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    return places


@pytest.fixture
def put(places):
    """Hand a part to the daemon; returns how many bytes it has."""
    journal = EventLog(places.log)
    uploads = Uploads(places, journal, InputStore(places, journal))

    def put(offset, data):
        return uploads.put(None, PutRequest(DIGEST, len(MODEL), offset, data)).count

    yield put
    journal.close()


def test_the_daemon_takes_a_file_in_parts_and_verifies_it(places, put):
    assert put(0, b"") == 0
    half = len(MODEL) // 2
    assert put(0, MODEL[:half]) == half
    assert put(0, b"again") == half
    assert put(half, MODEL[half:]) == put(0, b"") == len(MODEL)
    kept = places.files / DIGEST
    assert (kept.read_bytes(), kept.stat().st_mode & 0o777) == (MODEL, 0o400)


def test_a_file_that_was_damaged_at_the_daemon_gives_way_to_the_good_one(places, put):
    (places.files / DIGEST).write_bytes(b"damaged")
    assert put(0, b"") == 0
    assert put(0, MODEL) == len(MODEL)
    assert (places.files / DIGEST).read_bytes() == MODEL


def test_a_whole_that_is_another_one_is_never_kept(places, put):
    assert put(0, b"x" * len(MODEL)) == 0
    with pytest.raises(Refused, match="more bytes"):
        put(0, MODEL + b"!")
    assert list(places.files.iterdir()) == list(places.incoming.iterdir()) == []


def test_a_worker_never_keeps_what_another_digest_names(tmp_path):
    places = StatePaths(tmp_path / "own")
    places.make_folders()

    class Liar:
        def ask(self, verb, request):
            return FilePart(5, b"other")

    inputs = InputCache(Liar(), WorkerPaths(places, shared=False))
    with pytest.raises(ValueError, match="another file"):
        inputs.fetch(make_spec())
    assert list(places.scenes.iterdir()) == []


def test_files_travel_to_workers_and_into_the_process_of_the_run(here, monkeypatch):
    sut = SutReference(
        "m", "learned", {"reads": "model"}, attach_files({"model": here / "policy.onnx"})
    )
    specs = [replace(make_spec(i), sut=sut) for i in range(2)]
    elsewhere = here / "elsewhere"
    with daemon_at(here / "state") as daemon, daemon.client() as client:
        client.submit(submission_of("c", *specs))
        assert (daemon.state / "files" / DIGEST).read_bytes() == MODEL
        # The worker has another user's cache: what it needs it has from the daemon.
        monkeypatch.setenv("XDG_CACHE_HOME", str(here / "other"))
        with worker_for(daemon, 1, "--state", str(elsewhere)):
            eventually(lambda: finished(client, 2))
        (own,) = (elsewhere / "work").iterdir()
        assert [path.name for path in (own / "files").iterdir()] == [DIGEST]
        for run in ("c.0", "c.1"):
            trace = Path(client.run(run).row.trace)
            assert trace.read_bytes().endswith(DIGEST.encode())
        assert not user_files_folder().exists()


def test_a_submission_without_its_files_is_refused(places):
    lacking = SutReference("m", "mine", {}, {"model": DIGEST})
    submission = submission_of("c", replace(make_spec(), sut=lacking))
    with pytest.raises(Refused, match='the file "model" of m was not sent along'):
        admit_submission(submission, places)
    (places.files / DIGEST).write_bytes(MODEL)
    admit_submission(submission, places)


def test_as_many_files_are_kept_as_campaigns_need(places, put):
    for number in range(5000):
        (places.files / f"{number:064x}").touch()
    assert put(0, MODEL) == len(MODEL)
