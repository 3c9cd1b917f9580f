"""Stacks in containers, of an engine that a script pretends to be."""

import pytest

from daemon.model.sut import SutFailure
from tests.parts import eventually
from tests.stacks.ros2.holder import supervisor_of
from tests.stacks.ros2.parts.started import PYTHON, nothing_left, printed, relay_file, setup_file

IMAGE = {"image": "my/nav2:1.4"}


def test_stack_and_relay_live_in_one_container(start, tmp_path, engine):
    params = tmp_path / "params file.yaml"
    params.touch()
    relay = relay_file(tmp_path, "import os, time\nprint(dict(os.environ))\ntime.sleep(600)\n")
    stack = start(
        "echo stack $ROS_LOCALHOST_ONLY $HOME; trap 'echo bye; exit 0' INT; "
        "while :; do sleep 0.05; done",
        container=IMAGE | {"options": ["--shm-size", "512m"]},
        environment=setup_file(tmp_path, "export ROS_DISTRO=humble\n"),
        files={"params": str(params)},
        relay=relay,
        python=PYTHON,
        grace=600.0,
    )
    printed(stack, f"stack 1 {stack.folder}/home")
    printed(stack, f"'SCENARIO_SOCKET': '{stack.socket}'")
    token = stack.folder.name
    ((verb, *words),) = engine()
    assert verb == "run"
    options = " ".join(words[: words.index("my/nav2:1.4")])
    assert options.startswith(
        f"--rm --init --name scenario-{token} --label scenario={token} --network none "
        f"--volume {stack.folder}:{stack.folder} "
    )
    assert " --user 0:0 " in options
    assert f"--volume {params}:{params}:ro" in options
    assert f" --env SCENARIO_STACK={token} " in options
    assert options.endswith(" --shm-size 512m")
    assert stack.ended() == ""
    stack.release()
    assert b"bye" in stack.outputs()["stack.txt"]
    nothing_left(stack)


def test_a_container_that_does_not_listen_is_killed_by_its_name(start, engine):
    stack = start("echo up; sleep 600", container={"image": "ignores/it"}, grace=0.0)
    printed(stack, "up")
    stack.release()
    name = f"scenario-{stack.folder.name}"
    assert ["kill", name] in engine()
    assert ["rm", "-f", name] in engine()
    nothing_left(stack)


def test_a_container_may_start_its_own_command(start, engine):
    stack = start("", container=IMAGE | {"engine": "docker"})
    printed(stack, "own command")
    assert engine()


def test_the_end_of_stack_and_relay_in_a_container_is_told(start, tmp_path, engine):
    relay = {"relay": relay_file(tmp_path, "raise SystemExit(4)\n"), "python": PYTHON}
    for launch, keys, words in (
        ("echo Error: no space left; exit 125", {},
         'the container cannot be started: "Error: no space left"'),
        ("exit 5", {}, "the launch command ended with exit code 5"),
        ("sleep 600", relay, "the relay ended with exit code 4"),
    ):  # fmt: skip
        assert eventually(start(launch, container=IMAGE, **keys).ended) == words


def test_an_engine_or_an_image_that_is_missing_is_named(start, tmp_path, monkeypatch, engine):
    with pytest.raises(SutFailure, match="podman knows no image my/typo"):
        start("", container={"image": "my/typo"})
    (tmp_path / "sh").symlink_to("/bin/sh")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SutFailure, match="there is no podman on this machine"):
        start(container=IMAGE)


def test_the_container_of_a_killed_supervisor_is_ended(start, engine):
    stack = start("echo up; sleep 600", container=IMAGE)
    printed(stack, "up")
    supervisor_of(stack.folder).kill()
    eventually(stack.ended)
    stack.release()
    assert ["kill", f"scenario-{stack.folder.name}"] in engine()
    nothing_left(stack)
