"""What processes print: valid at any moment, bounded, its first and its last part kept."""

import pytest

from daemon.supervision.output_file import OutputFile

MOST = OutputFile.HEAD + OutputFile.TAIL


def stream(length):
    """Bytes of which no two parts are alike."""
    return b"".join(b"%07d\n" % number for number in range(length // 8 + 1))[:length]


@pytest.mark.parametrize("piece", [1 << 16, 1000 * 1000])
def test_it_holds_the_first_and_the_last_part_at_any_moment(tmp_path, piece):
    path, data = tmp_path / "output.txt", stream(3 * MOST)
    file = OutputFile(path)
    for start in range(0, len(data), piece):
        file.write(data[start : start + piece])
        said = data[: start + piece]
        found = OutputFile.read(path)
        assert path.stat().st_size <= MOST + 8
        if len(said) <= MOST:
            assert found == path.read_bytes() == said
            continue
        cut = f"\n[... {len(said) - MOST} bytes left out ...]\n".encode()
        assert found == said[: OutputFile.HEAD] + cut + said[-OutputFile.TAIL :]
    file.close()


def test_a_file_of_another_kind_is_read_in_part(tmp_path):
    path = tmp_path / "output.txt"
    assert OutputFile.read(path) == b""
    path.write_bytes(stream(5 * MOST))
    found = OutputFile.read(path)
    assert len(found) < MOST + 100
    assert found.startswith(stream(100))
    assert found.endswith(stream(5 * MOST)[-100:])
