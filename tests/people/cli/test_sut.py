"""``scenario sut``: every parameter, where it was written, who hears the laser."""

from scenario_tui.cli import command_line
from tests.people.cli.outputs import declared


def shown(capsys, *arguments):
    assert command_line.invoke(["sut", "show", *arguments]) == 0
    return capsys.readouterr().out


def test_the_ros_stack_is_shown_with_places_defaults_and_wiring(campaigns, capsys):
    text = shown(capsys, str(campaigns / "suts" / "a2s-blind.yaml"))
    line = next(line for line in text.splitlines() if "odom_model_type" in line)
    assert line.split() == ["odom_model_type", "omni-corrected", "a2s.yaml:11"]
    idle = next(line for line in text.splitlines() if "stop_time_buffer" in line)
    assert "never reads it" in idle
    assert "clearing_radius 0.46" in text
    assert "amcl listens to /scan_front: hears it" in text
    assert "local costmap listens to /robile_john/scan_front: does not hear it" in text


def test_scripts_get_the_merged_tree(campaigns, capsys):
    found = declared(shown(capsys, "--json", str(campaigns / "suts" / "fro-omni.yaml")))
    assert found["schema"] == "scenario/sut/1"
    assert found["reference"]["parameters"]["move_base"]["DWAPlannerROS"]["sim_time"] == 2.5
    assert (
        "controller_frequency" not in found["reference"]["parameters"]["move_base"]["DWAPlannerROS"]
    )
    assert found["defaults"]["move_base/DWAPlannerROS"]["controller_frequency"] == 20.0
    assert found["places"]["amcl/kld_z"].endswith("fro-diff/amcl.yaml:15:8")
    assert found["ros"]["wiring"] == {"amcl": True, "global_costmap": True, "local_costmap": True}


def test_scripts_learn_who_hears_a_laser_of_several(campaigns, capsys):
    found = declared(shown(capsys, "--json", str(campaigns / "suts" / "shuttle-nav.yaml")))
    assert set(found["ros"]["topics"]["by_laser"]) == {"front", "rear"}
    assert found["ros"]["wiring"] == {"amcl": True, "global_costmap": True, "local_costmap": True}


def test_other_kinds_show_what_was_written(tmp_path, capsys):
    path = tmp_path / "slow.yaml"
    path.write_text("sut: slow\nkind: pilot\nparameters: {max_speed: 0.2}\n")
    text = shown(capsys, str(path))
    assert "slow, kind pilot" in text
    assert "max_speed" in text


def test_a_ros2_stack_is_shown_with_what_applies_and_is_not_started(tmp_path, capsys):
    (tmp_path / "p.yaml").write_text("a: 1\n")
    base = tmp_path / "nav2.yaml"
    mark = tmp_path / "started"
    base.write_text(
        f"sut: nav2\nkind: ros2\nlaunch: touch {mark} {{map}} {{params}}\n"
        "files: {params: p.yaml}\nstart-up: 2 min\ntopics: {scan: front}\n"
    )
    path = tmp_path / "mine.yaml"
    path.write_text("sut: mine\nlike: nav2\npatience: 2 s\nready: [amcl]\n")
    text = shown(capsys, str(path))
    assert "mine, kind ros2, not repeatable" in text
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.strip()}
    assert rows["patience"] == ["2", "s", "mine.yaml:3"]
    assert rows["start-up"] == ["2", "min", "nav2.yaml:5"]
    assert "files: params (sha256 " in text
    left_out = text.partition("not written anywhere")[2]
    assert "late 5 %" in left_out
    assert "patience" not in left_out
    assert "command /cmd_vel" in left_out
    body = declared(shown(capsys, "--json", str(path)))
    assert body["defaults"]["stack"]["period"] == "0.05 s"
    assert "scan" not in body["defaults"]["topics"]
    assert not mark.exists()


def test_bad_ros_files_are_reported_with_all_their_problems(tmp_path, capsys):
    (tmp_path / "amcl.yaml").write_text("odom_alpha1: -1.0\nkld_err: small\n")
    path = tmp_path / "bad.yaml"
    path.write_text("sut: bad\nkind: ros\nfiles: {amcl: amcl.yaml}\n")
    for command in (("sut", "show"), ("check",)):
        assert command_line.invoke([*command, str(path)]) == 2
        told = capsys.readouterr().err
        assert "amcl.yaml:1:14: error: odom_alpha1: must be greater than or equal to 0" in told
        assert "amcl.yaml:2:10: error: kld_err: must be a number (given: 'small')" in told
        assert "2 errors" in told


def test_what_a_refused_configuration_would_be_is_shown_before_what_is_wrong(tmp_path, capsys):
    path = tmp_path / "slow.yaml"
    path.write_text("sut: slow\nkind: pilot\nparameters: {max_speed: fast, patience: 3.0}\n")
    assert command_line.invoke(["sut", "show", str(path)]) == 2
    printed = capsys.readouterr()
    row = next(line for line in printed.err.splitlines() if "patience" in line)
    assert row.split() == ["patience", "3", "slow.yaml:3"]
    assert "max_speed" in printed.err
