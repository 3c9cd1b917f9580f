"""Scenes and files come while the worker's loop goes on."""

import random
from dataclasses import replace

from daemon.model.attachments import attach_files
from daemon.model.run_state import RunState
from daemon.model.spec import SutReference
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished, worker_for

FILES = 6


def test_no_run_is_begun_twice_while_its_files_come(tmp_path, monkeypatch):
    """Each run waits for kernels, then for a file; leases come late, and renewals are due."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "faults").mkdir()
    (tmp_path / "faults" / "lease").write_text("slow")
    log, specs = tmp_path / "log", []
    for number in range(FILES):
        (tmp_path / f"file-{number}").write_bytes(random.Random(number).randbytes(300_000))
        attached = attach_files({"model": tmp_path / f"file-{number}"})
        parameters = {"reads": "model", "log": str(log)}
        sut = SutReference(f"sut-{number}", "learned", parameters, attached)
        specs.append(replace(make_spec(number), sut=sut))
    with (
        daemon_at(tmp_path / "state", module="tests.batch.failing_daemon") as daemon,
        daemon.client() as client,
    ):
        client.submit(submission_of("c", *specs))
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
        options = ("--state", str(tmp_path / "elsewhere"))
        hesitant = "tests.batch.hesitant_worker"
        with worker_for(daemon, 2, *options, module=hesitant) as worker:
            eventually(lambda: finished(client, FILES) or worker.process.poll() is not None)
            assert worker.process.poll() is None, worker.output
            assert "not started" not in worker.output
        rows = client.runs("c").rows
        assert [(row.state, row.attempt) for row in rows] == [(RunState.DONE, 1)] * FILES
        assert len(log.read_text().splitlines()) == FILES
