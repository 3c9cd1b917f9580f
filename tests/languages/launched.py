"""Launch files written for a test, and what they come to."""

import pytest

from grammars.roslaunch import LaunchSettings, load_launch
from grammars.text.diagnostics import InputError, Where

OF_INTEREST = {("move_base", "move_base"), ("amcl", "amcl")}


def launch(path, *more, **settings):
    """Load launch files that are named on line 1 of a file."""
    files = [(file, Where("sut.yaml", 1, 1)) for file in (path, *more)]
    read_settings = LaunchSettings(lambda key: Where("sut.yaml", 2, 1), **settings)
    return load_launch(files, read_settings, OF_INTEREST)


def write(folder, name, body):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"<launch>\n{body}\n</launch>\n")
    return path


def started(folder, body, **settings):
    return launch(write(folder, "a.launch", body), **settings)


def node(loaded, name):
    (found,) = (one for one in loaded.nodes if one.name == name)
    return found


def parameters(loaded, name):
    return {"/".join(path): p.value for path, p in node(loaded, name).parameters.items()}


def remaps(loaded, name):
    return {source: remap.to for source, remap in node(loaded, name).remaps.items()}


def errors(folder, body, **settings):
    with pytest.raises(InputError) as caught:
        started(folder, body, **settings)
    return [str(one).replace(f"{folder}/", "") for one in caught.value.findings]


AMCL = '<node pkg="amcl" type="amcl" name="amcl">{}</node>'
