"""Launch files that start a node of a package, near another one."""

import pytest

from grammars.roslaunch import launch_files_starting

AMCL = "<launch><node name='amcl' pkg='amcl' type='amcl'/></launch>"


@pytest.fixture
def package(tmp_path):
    files = {
        "package.xml": AMCL,
        "demo.launch": "<launch/>",
        "launch/amcl.launch": AMCL,
        "launch/parts/amcl.launch.xml": AMCL.replace("'", '"'),
        "launch/other.launch": AMCL.replace("pkg='amcl'", "pkg='amcl_more'"),
        "launch/off.launch": f"<launch><!-- {AMCL} --></launch>",
        "launch/notes.txt": AMCL,
        ".old/amcl.launch": AMCL,
    }
    for name, text in files.items():
        path = tmp_path / "robot" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "robot"


def found(package, around):
    paths = launch_files_starting("amcl", package / around)
    return [path.relative_to(package).as_posix() for path in paths]


def test_the_whole_package_is_searched_for_nodes_that_are_started(package):
    expected = ["launch/amcl.launch", "launch/parts/amcl.launch.xml"]
    assert found(package, "demo.launch") == found(package, "launch/other.launch") == expected


def test_without_a_package_only_the_folder_is_searched(package):
    (package / "package.xml").unlink()
    assert found(package, "launch/other.launch") == ["launch/amcl.launch"]
    assert found(package, "demo.launch") == []
