"""Whole or not at all: what stands in a file that is written again, and in the folder beside."""

import os
import shutil

import pytest

from grammars.text.files import matching_paths, move_durably, replacing, write_atomically


def test_a_file_is_replaced_as_a_whole_and_nothing_is_left_beside_it(tmp_path):
    path = tmp_path / "kept"
    write_atomically(path, b"before")
    with replacing(path, mode=0o400) as temporary:
        temporary.write_bytes(b"after")
        assert path.read_bytes() == b"before"
    assert path.read_bytes() == b"after"
    assert path.stat().st_mode & 0o777 == 0o400
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("mode", [0o600, 0o400])
def test_a_private_file_is_private_while_it_is_written(tmp_path, mode):
    before = os.umask(0)
    try:
        with replacing(tmp_path / "kept", mode=mode) as temporary:
            temporary.write_bytes(b"secret")
            assert temporary.stat().st_mode & 0o077 == 0
    finally:
        os.umask(before)
    assert (tmp_path / "kept").stat().st_mode & 0o777 == mode


def test_what_fails_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "kept"
    write_atomically(path, b"before")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, b"after")
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_to_the_file_itself_goes_too(tmp_path):
    path = tmp_path / "kept"
    path.write_bytes(b"same")
    with replacing(path) as temporary:
        os.link(path, temporary)
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_is_complete_gets_its_name(tmp_path):
    (tmp_path / "part").write_bytes(b"all")
    move_durably(tmp_path / "part", tmp_path / "whole")
    assert [path.name for path in tmp_path.iterdir()] == ["whole"]


def test_folders_that_go_while_they_are_listed_count_as_empty(tmp_path):
    for name in ("first", "second", ".hidden"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "trace").touch()
    paths = matching_paths(tmp_path, "*/trace")
    first = next(paths)
    for folder in tmp_path.iterdir():
        if folder != first.parent:
            shutil.rmtree(folder)
    assert list(paths) == []
    assert list(matching_paths(tmp_path, "*/trace")) == [first]
    assert list(matching_paths(tmp_path / "gone", "*")) == []
