"""What keeps stacks apart: domains, environments, folders; with real shells and processes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.isolation import (
    OWN_DOMAINS,
    DomainTaken,
    environment_script,
    isolating_variables,
    lock_domain,
    runtime_folder,
    without_ours,
)
from grammars.text.files import private_folder


def sourced(script, shell="bash", **environ):
    words = [shell, "-c", f"{script}\ncommand env -0"]
    path = {"PATH": os.environ["PATH"]}
    return subprocess.run(words, env=path | environ, capture_output=True, text=True, check=False)


def environment(script, shell="bash", **environ):
    done = sourced(script, shell, **environ)
    assert done.returncode == 0, done.stderr
    entries = (entry.partition("=") for entry in done.stdout.split("\0") if entry)
    return {name: value for name, _, value in entries}


def test_two_runs_never_get_the_same_domain():
    held = [lock_domain(None) for _ in range(20)]
    domains = {domain for domain, _ in held}
    assert len(domains) == 20
    assert domains <= set(OWN_DOMAINS)
    taken = held[0][0]
    with pytest.raises(DomainTaken, match=f"ROS_DOMAIN_ID {taken} is in use by another run"):
        lock_domain(taken)
    for _, holder in held:
        holder.close()


def test_a_domain_is_held_by_who_has_inherited_it_and_free_with_its_death():
    domain, holder = lock_domain(None)
    with subprocess.Popen(
        [sys.executable, "-c", "input()"], stdin=subprocess.PIPE, pass_fds=(holder.fileno(),)
    ) as other:
        holder.close()
        with pytest.raises(DomainTaken):
            lock_domain(domain)
        other.kill()
        other.wait()
        lock_domain(domain)[1].close()


def test_what_is_ours_alone_is_taken_out_of_the_environment(tmp_path):
    ours = tmp_path / "ours"
    (ours / "bin").mkdir(parents=True)
    (tmp_path / "link").symlink_to(ours)
    packages = "/opt/ros/jazzy/lib/python3.12/site-packages"
    kept = {"PYTHONPATH": packages, "MKL_NUM_THREADS": "6", "ROS_DISTRO": "jazzy"}
    names = ("VIRTUAL_ENV_PROMPT", "PYTHONSAFEPATH", "PYTHONHOME", "SCENARIO_STATE",
             "SCENARIO_NONCE")  # fmt: skip
    dropped = dict.fromkeys(names, "x") | {"VIRTUAL_ENV": str(ours), "OMP_NUM_THREADS": "1"}
    path = f"{ours}/bin:/usr/local/bin:{tmp_path}/link/bin:/usr/bin"
    found = without_ours(kept | dropped | {"PATH": path}, prefix=str(ours), base_prefix="/usr")
    assert found == kept | {"PATH": "/usr/local/bin:/usr/bin"}
    # Another virtual environment and its programs stay.
    environ = {"PATH": "/theirs/bin:/usr/bin", "VIRTUAL_ENV": "/theirs"}
    for prefix, base in (("/ours", "/usr"), ("/theirs", "/theirs")):
        assert without_ours(environ, prefix=prefix, base_prefix=base) == environ


@pytest.mark.parametrize("shell", ["bash", "sh"])
def test_setup_files_are_sourced_in_order_and_what_is_set_wins(tmp_path, shell):
    """Also one below the home of who starts it; what one has set of its shell is over then."""
    (tmp_path / "my ws").mkdir()
    first, second = tmp_path / "my ws" / "first.sh", tmp_path / "second of two.sh"
    first.write_text("export ORDER=1 ONLY=first HOME=/wrong ROS_DOMAIN_ID=7; set -e\n")
    second.write_text("export ORDER=${ORDER}2 RMW=theirs SCENARIO_STACK=theirs\n")
    script = environment_script(
        ("~/my ws/first.sh", str(second)),
        {"RMW": 'it\'s "$HOME"\n`id`', "ROS_LOG_DIR": "/chosen"},
        {"HOME": "/own", "ROS_LOG_DIR": "/own/log"},
        {"ROS_DOMAIN_ID": "42", "SCENARIO_STACK": "token"},
    )
    found = environment(f"{script}\nfalse", shell, HOME=str(tmp_path))
    expected = {
        "ORDER": "12",
        "ONLY": "first",
        "HOME": "/own",
        "RMW": 'it\'s "$HOME"\n`id`',
        "ROS_LOG_DIR": "/chosen",
        "ROS_DOMAIN_ID": "42",
        "SCENARIO_STACK": "token",
    }
    assert expected.items() <= found.items()
    assert "scenario_setup" not in found


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "there is no setup file {file}"),
        ("export A=1\nfalse\n", "the setup file {file} failed: its last command ended with code 1"),
        ("exit 3\n", "the setup file {file} ended its shell, exit code 3"),
        ("set -e\nls /there/is/no/such/thing\n", "the setup file {file} ended its shell, exit "),
    ],
)
def test_a_setup_file_that_fails_is_named(tmp_path, content, words):
    file = tmp_path / "setup.bash"
    if content is not None:
        file.write_text(content)
    done = sourced(environment_script((str(file),), {}, {}, {}))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"scenario: {words.format(file=file)}")


@pytest.mark.parametrize(
    ("setup", "variables", "said"),
    [
        ("export ROS_DISTRO=humble", {}, {"ROS_LOCALHOST_ONLY": "1"}),
        ("export ROS_DISTRO=jazzy", {}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}),
        ("true", {}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}),
        *(("true", {"ROS_AUTOMATIC_DISCOVERY_RANGE": own}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": own})
          for own in ("SUBNET", "OFF")),
    ],
)  # fmt: skip
def test_discovery_stays_on_the_machine_unless_the_sut_file_says_otherwise(
    tmp_path, setup, variables, said
):
    """In the words of the distribution, which is known once setup files have been sourced."""
    file = tmp_path / "setup.sh"
    file.write_text(f"{setup}\n")
    script = environment_script((str(file),), variables, {}, {})
    inherited = {"ROS_LOCALHOST_ONLY": "0", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    found = environment(script, **inherited)
    assert {name: found[name] for name in inherited if name in found} == said


def test_packages_of_the_users_home_stay_in_sight(tmp_path):
    folder, home = tmp_path / "stack", tmp_path / "home"
    folder.mkdir()
    (home / ".local").mkdir(parents=True)
    found = isolating_variables(folder, home)
    assert found["PYTHONUSERBASE"] == str(home / ".local")
    for name in ("HOME", "ROS_HOME", "ROS_LOG_DIR"):
        assert Path(found[name]).parent == folder
        assert Path(found[name]).is_dir()


def test_the_runtime_folder_is_private_and_paths_of_sockets_short(temporary, monkeypatch):
    found = runtime_folder()
    assert found.is_relative_to(temporary)
    assert found.stat().st_mode & 0o777 == 0o700
    found.chmod(0o755)
    assert runtime_folder().stat().st_mode & 0o777 == 0o700
    (long := temporary / ("x" * 90)).mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(long))
    assert len(os.fsencode(runtime_folder())) < 60


def test_a_folder_that_is_a_link_is_refused(temporary):
    (temporary / "target").mkdir()
    (temporary / "link").symlink_to(temporary / "target")
    with pytest.raises(PermissionError, match="belongs to somebody else"):
        private_folder(temporary / "link")
    (temporary / f"scenario-{os.getuid()}").symlink_to(temporary / "target")
    with pytest.raises(SutFailure, match="TMPDIR"):
        runtime_folder()
