"""What the tests of daemons stand on: ports of their own, and parts that are forked."""

import errno
import signal
import socket
import subprocess

import pytest

from tests.parts import ROOT, Part, free_endpoint
from tests.prepared_parts import PreparedProcess, start_prepared


def test_a_free_endpoint_is_kept_for_who_listens_there():
    port = int(free_endpoint().rpartition(":")[2])
    with socket.socket() as other:
        with pytest.raises(OSError, match="in use") as caught:
            other.bind(("127.0.0.1", port))
        assert caught.value.errno == errno.EADDRINUSE
    with socket.socket() as caller:
        assert caller.connect_ex(("127.0.0.1", port)) == errno.ECONNREFUSED
    for _ in range(2):  # a daemon, and the same one started again
        socket.create_server(("127.0.0.1", port)).close()


def test_a_free_endpoint_of_all_addresses_is_free_at_each_of_them():
    with socket.socket(socket.AF_INET6) as probe:
        try:
            probe.bind(("::1", 0))
        except OSError:
            pytest.skip("there is no IPv6 here")
    port = int(free_endpoint("::").rpartition(":")[2])
    for host in ("127.0.0.1", "127.0.0.2", "::1"):
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.socket(family) as other, pytest.raises(OSError, match="in use"):
            other.bind((host, port))
    socket.create_server(("::", port), family=socket.AF_INET6, dualstack_ipv6=True).close()


def test_a_forked_part_is_a_process_as_others_are(tmp_path):
    state = tmp_path / "state"
    options = ("--state", str(state), "--listen", free_endpoint(), "--slots", "0")
    first = Part("serve", tmp_path / "first.log", *options)
    assert isinstance(first.process, PreparedProcess)
    with pytest.raises(subprocess.TimeoutExpired):
        first.wait(0.0)
    first.kill()
    assert first.process.poll() == -signal.SIGKILL
    wrong = Part("serve", tmp_path / "wrong.log", "--slots", '"none"')
    assert wrong.wait() == 1
    assert "unable to parse string as an integer" in wrong.output


def test_where_python_is_set_up_otherwise_a_part_is_not_forked(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert start_prepared(["daemon", "serve"], ROOT, 1) is None
    part = Part("serve", tmp_path / "log", "--slots", '"none"')
    assert isinstance(part.process, subprocess.Popen)
    assert part.wait() == 1
