"""Whole or not at all: what stands in a file that is written again, and in the folder beside."""

import os
import shutil

import pytest

from grammars.text.diagnostics import InputError
from grammars.text.documents import StrictModel, load_yaml, read_model
from grammars.text.file_kinds import kind_of_file
from grammars.text.files import (
    matching_paths,
    move_durably,
    replacing,
    user_folder,
    write_atomically,
)
from grammars.text.sources import read_text


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


def test_without_a_home_only_caches_have_a_place_of_their_own(tmp_path, monkeypatch):
    def homeless(_):
        raise RuntimeError("could not determine the home directory")

    for kind in ("cache", "config", "state"):
        monkeypatch.setattr(f"platformdirs.user_{kind}_path", homeless)
    monkeypatch.delenv("SCENARIO_STATE", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert user_folder("cache") == tmp_path / f"scenario-{os.getuid()}" / "cache"
    with pytest.raises(FileNotFoundError, match="there is no home directory .* set HOME, or"):
        user_folder("state")
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    assert user_folder("config") == tmp_path / "state" / "config"


KINDS = {
    b"#ROSBAG V2.0\nE\0\0\xff": "a bag of ROS 1",
    b"SQLite format 3\0\xff": "a database, such as a bag of ROS 2",
    b"\x89PNG\r\n\x1a\n": "a picture",
    b"GIF89a": "GIF, TIFF or WebP",
    b"P5 3 2 255\n\xff": "a picture",
    b"PK\x03\x04": "compressed",
    b"\x1f\x8b\x08": "compressed",
    b"ISO-10303-21;\nHEADER;": "an IFC model",
    b"  0\nSECTION\n  2\nHEADER\n": "a DXF drawing",
    b"<?xml version='1.0'?>\n<sdf version='1.6'><world/></sdf>": "a model of Gazebo",
    b"\xef\xbb\xbf<robot name='x'>": "a URDF model",
    b"<kml>": "an XML or HTML file",
    b"robot: courier\nfootprint: {radius: 0.2 m}\n": "a robot",
    b"mission: go\nwaypoints: []\n": "a mission",
    b"campaign: one\nscenarios: {}\n": "a campaign",
    b"image: m.pgm\nresolution: 0.05\n": "a map",
    b"amcl:\n  ros__parameters: {}\n": "a parameter file of ROS",
    b"name: house\nlevels: {}\n": "a building of Open-RMF",
    b"note: text\n": None,
}


@pytest.mark.parametrize("content", KINDS)
def test_files_of_other_kinds_are_told_by_their_content(tmp_path, content):
    path = tmp_path / "file"
    path.write_bytes(content)
    kind = kind_of_file(path)
    assert (kind and kind.title) == KINDS[content]
    os.mkfifo(tmp_path / "pipe")
    assert kind_of_file(tmp_path / "pipe") is None
    if kind:
        # Whatever reads it as YAML names the kind.
        with pytest.raises(InputError, match=f"is {kind.title}"):
            read_model(load_yaml(path), StrictModel)


@pytest.mark.parametrize(
    ("content", "place", "words"),
    [
        (b"a: 1\n# K\xfcche\n", ":2:4:", 'byte 8 is "ü" in Windows-1252'),
        (b"# 10 \xc2\xb0 \x96\n", ":1:8:", 'byte 8 is "–" in Windows-1252'),
        ("a: 1".encode("utf-16"), ":", "not UTF-8 text but UTF-16"),
    ],
)
def test_other_encodings_are_named(tmp_path, content, place, words):
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"file{place}.*{words}"):
        read_text(path)
