import pytest

from tests.parts import daemon_at


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A daemon without workers of its own for the tests of a file."""
    with daemon_at(tmp_path_factory.mktemp("shared") / "state") as part:
        part.client().close()  # it is up: some tests ask past the client
        yield part


@pytest.fixture
def client(shared):
    with shared.client() as connected:
        yield connected
