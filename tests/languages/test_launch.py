"""Launch files mean what they mean to roslaunch: parameters, namespaces, remaps, args, includes."""

import pytest

from grammars.text.diagnostics import InputError
from grammars.text.documents import load_yaml
from tests.languages.errors.goldens import renew
from tests.languages.launched import AMCL, errors, launch, node, parameters, started, write
from tests.languages.plans import HERE


def meaning(path):
    """Return what the launch files come to that a file of settings names."""
    settings = load_yaml(path).data
    files = [path.parent / file for file in settings.pop("files")]
    packages = tuple(path.parent / folder for folder in settings.pop("packages", ()))
    try:
        loaded = launch(*files, packages=packages, **settings)
    except InputError as refused:
        return "".join(f"{finding}\n" for finding in refused.findings)
    of_nodes = [parameter for each in loaded.nodes for parameter in each.parameters.values()]
    lines = [
        f"/{'/'.join(name)} = {parameter.value!r} {parameter.where}"
        for name, parameter in loaded.parameters.items()
        if parameter not in of_nodes
    ]
    for each in loaded.nodes:
        lines.append(f"{each.name} of {each.package}")
        for name, parameter in each.parameters.items():
            lines.append(f"    {'/'.join(name)} = {parameter.value!r} {parameter.where}")
            lines += [f"        {key}: {where}" for key, where in parameter.inside.items()]
            lines += [f"        missing: {finding}" for finding in parameter.missing]
        lines += [f"    {source} -> {remap.to}" for source, remap in each.remaps.items()]
    lines += [f"left out: {file}" for file in loaded.left_out]
    lines += map(str, loaded.warnings)
    return "".join(f"{line}\n" for line in lines)


def test_launch_files_come_to_what_roslaunch_makes_of_them(golden, tmp_path):
    golden("launches.txt", renew(HERE / "launches.txt", tmp_path / "files", meaning))


def test_commands_are_not_run(tmp_path):
    body = f'<param name="a" command="touch {tmp_path / "mark"}"/>'
    assert node(started(tmp_path, AMCL.format(body)), "/amcl").parameters["a",].missing
    assert not (tmp_path / "mark").exists()


def test_the_shell_is_not_asked_but_its_value_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("MY_ROBOT", "burger")
    (message,) = errors(tmp_path, AMCL.format('<rosparam file="$(env MY_ROBOT)"/>'))
    assert "in this shell it is MY_ROBOT: burger" in message
    optional = AMCL.format('<param name="a" value="$(optenv MY_ROBOT no one)"/>')
    assert parameters(started(tmp_path, optional), "/amcl") == {"a": "no one"}
    assert parameters(started(tmp_path, optional, env={"MY_ROBOT": "x"}), "/amcl") == {"a": "x"}


def test_args_that_double_each_other_are_refused(tmp_path):
    doubled = "".join(f'<arg name="a{k + 1}" value="$(arg a{k})$(arg a{k})"/>' for k in range(40))
    messages = errors(tmp_path, f'<arg name="a0" value="lol"/>{doubled}')
    assert "more than 10,000 characters" in messages[0]


def test_launch_files_that_include_each_other_again_and_again_end(tmp_path):
    for index in range(20):
        include = f'<include file="$(dirname)/{index + 1}.launch"/>' * 2
        write(tmp_path, f"{index}.launch", include)
    write(tmp_path, "20.launch", "")
    messages = errors(tmp_path, '<include file="$(dirname)/0.launch"/>')
    assert "without end" in messages[0]


def test_names_no_file_can_have_are_said_where_they_stand(tmp_path):
    with pytest.raises(InputError, match=r"a\.launch:2:58: .* too long"):
        started(tmp_path, AMCL.format(f'<rosparam file="{"a" * 5000}"/>'))
