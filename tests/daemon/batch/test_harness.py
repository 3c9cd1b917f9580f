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
