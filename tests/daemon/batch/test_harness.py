"""What the tests of daemons stand on: ports that no other process of the tests is given."""

from __future__ import annotations

import errno
import socket

import pytest

from tests.daemon.batch.harness import free_endpoint


def test_a_free_endpoint_is_kept_for_who_listens_there() -> None:
    port = int(free_endpoint().rpartition(":")[2])
    with socket.socket() as other:
        with pytest.raises(OSError, match="in use") as caught:
            other.bind(("127.0.0.1", port))
        assert caught.value.errno == errno.EADDRINUSE
    with socket.socket() as caller:
        assert caller.connect_ex(("127.0.0.1", port)) == errno.ECONNREFUSED
    for _ in range(2):  # a daemon, and the same one started again
        socket.create_server(("127.0.0.1", port)).close()


def test_a_free_endpoint_of_all_addresses_is_free_at_each_of_them() -> None:
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
