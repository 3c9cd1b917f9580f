"""Files sent as one value: what leads elsewhere or is no bundle is refused as a whole."""

import base64

import pytest

from daemon.model.bundles import read_bundle, unpack_bundle
from daemon.model.search import BundledFile


def coded(data):
    return base64.b64encode(data).decode()


@pytest.mark.parametrize(
    "path",
    [
        "../a",
        "/a",
        "a/../../b",
        "",
        "a//b",
        "./a",
        "a\\b",
        "a\nb",
        "a\0b",
        "x" * 201,
        "a/" * 50 + "b",
    ],
)
def test_paths_that_lead_elsewhere_are_refused(path, tmp_path):
    with pytest.raises(ValueError, match="no path"):
        unpack_bundle((BundledFile(path, coded(b"x")),), tmp_path / "there")
    assert not (tmp_path / "there").exists()


def test_what_no_bundle_is_is_refused_before_anything_is_written(tmp_path):
    there = tmp_path / "there"
    good = BundledFile("a", coded(b"x"))
    for files, said in (
        ((), "1 to"),
        ((good, good), "twice"),
        ((good, BundledFile("a/b", coded(b"x"))), "a file and a folder"),
        ((good, BundledFile("b", "not base64!")), "no base64"),
        ((good, BundledFile("b", "A" * (48 * 2**20))), "MiB"),
    ):
        with pytest.raises(ValueError, match=said):
            unpack_bundle(files, there)
        assert not there.exists()


def test_what_is_unpacked_is_its_owners_alone(tmp_path):
    unpack_bundle((BundledFile("a/b.yaml", coded(b"x: 1\n")),), tmp_path / "there")
    file = tmp_path / "there" / "a" / "b.yaml"
    assert file.read_bytes() == b"x: 1\n"
    assert file.stat().st_mode & 0o077 == 0
    assert file.parent.stat().st_mode & 0o077 == 0
    (file.parent / "link").symlink_to("/etc/passwd")
    assert read_bundle(tmp_path / "there") == (BundledFile("a/b.yaml", coded(b"x: 1\n")),)
    with pytest.raises(FileExistsError):
        unpack_bundle((BundledFile("c", coded(b"x")),), tmp_path / "there")
