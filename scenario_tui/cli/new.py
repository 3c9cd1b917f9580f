"""The command that writes a new campaign, or lists the layers that campaigns can name."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from grammars.text.diagnostics import InputError, Where
from grammars.text.words import command_line
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.options import refuse_typed, why_no_folder
from scenario_tui.cli.output import (
    plain_table,
    print_commands,
    report_findings,
    say,
    stdout_console,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from templates.new_campaign import Errand

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


@dataclass(frozen=True, slots=True)
class NewCampaign:
    """A new campaign: its file, and all written files."""

    campaign: str
    files: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class NamedLayer:
    """A layer that a campaign can name; ``file`` is empty for one that ships."""

    kind: str
    name: str
    about: str
    file: str
    ships: bool


@dataclass(frozen=True, slots=True)
class LayerList:
    """The layers that a campaign in a folder can name."""

    folder: str
    layers: tuple[NamedLayer, ...]


def new(
    context: typer.Context,
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="NAME",
            help="Name of the campaign and of its new folder.",
            show_default=False,
        ),
    ] = None,
    floorplan: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Use this building instead of a new flat.",
            autocompletion=completion.offers(completion.files(".fpm", ".jsonld")),
        ),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            metavar="FILE|NAME",
            help="Use this robot, a file or one that ships, instead of a new one.",
        ),
    ] = "",
    nav2: Annotated[
        bool,
        "Also test Nav2 (ROS 2 Jazzy, Kilted): write suts/my-nav2.yaml and parameters "
        "for the robot.",
    ] = False,
    listing: Annotated[
        bool,
        "--layers",
        "Write nothing; list the layers that a campaign in the folder NAME can name: "
        "robots, systems under test, plans, … Default: this folder.",
    ] = False,
) -> Answer[NewCampaign] | Answer[LayerList]:
    """Write a small campaign that runs, for you to change.

    It has a flat with a door, a robot, a mission and oracles, with every line explained. Existing
    files are not overwritten.
    """
    if listing:
        why = "belongs to a new campaign: leave it out"
        refuse_typed(context, ("floorplan", "robot", "nav2"), why)
        layers = LayerList(str(folder or Path()), tuple(_layers(folder or Path())))
        return Answer("layers", layers, partial(_print_layers, layers))
    if folder is None:
        raise typer.BadParameter("name the new campaign", param_hint="NAME")
    name = _campaign_name(folder)
    from grammars.model.robot_files import read_robot
    from grammars.text.documents import load_yaml, parse_yaml
    from templates.nav2 import NAV2, nav2_files
    from templates.new_campaign import ROBOT_FILE, new_campaign

    plan, errand = "", None
    if floorplan is not None:
        errand = _errand_in(floorplan)
        plan = Path(os.path.relpath(floorplan, folder)).as_posix()
    robot_file = _robot_file(robot, folder) if robot else None
    reference = "" if robot_file is None else _robot_reference(robot_file, folder)
    suts = ["pilot", NAV2] if nav2 else ["pilot"]
    files = new_campaign(name, plan=plan, errand=errand, robot=reference, suts=suts)
    if nav2:
        document = (
            load_yaml(robot_file) if robot_file else parse_yaml(files[ROBOT_FILE], ROBOT_FILE)
        )
        files |= nav2_files(read_robot(document))
    for file, text in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        # Exclusively: a file that somebody wrote there meanwhile is kept.
        with (folder / file).open("x", encoding="utf-8") as target:
            target.write(text)
    paths = tuple(str(folder / file) for file in files)
    say(f"wrote {len(files)} files to {folder}/: {', '.join(files)}")
    return Answer("new", NewCampaign(paths[0], paths), partial(_print_next_steps, paths))


def _campaign_name(folder: Path) -> str:
    """Return the name of a campaign in a new folder; raises :class:`typer.BadParameter`."""
    name = folder.resolve().name
    if not _NAME.fullmatch(name):
        raise typer.BadParameter(
            f'"{name}" cannot name a campaign: letters (a to z), digits, "_" and "-", beginning '
            "with a letter or digit",
            param_hint="NAME",
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise typer.BadParameter(
            f"{folder} exists already and is not overwritten: choose another name",
            param_hint="NAME",
        )
    return name


def _print_next_steps(files: tuple[str, ...]) -> None:
    from templates.nav2 import NAV2_FILE

    file = files[0]
    stacks = [path for path in files if path.endswith(NAV2_FILE)]
    start = [command_line("sut", "check", path, "--campaign", file) for path in stacks]
    print_commands(
        (command_line("check", file), "find every problem before anything runs"),
        *((command, "start Nav2, and see what it lacks") for command in start),
        (command_line("run", file), "run it here and now"),
        ("scenario new --layers", "robots and systems under test it can name"),
    )


def _errand_in(path: Path) -> Errand:
    """Return start and waypoints in a building; raises :class:`InputError`."""
    from daemon.campaign import LayerLibrary, LayerReference
    from grammars.scenery.composition import compile_scene
    from templates.new_campaign import propose_errand

    where = Where(str(path))
    if not path.is_file():
        raise InputError.at(where, "no such file", "--floorplan takes the file of a building")
    library = LayerLibrary(path.parent)
    plan = library.floorplan(LayerReference(path.name, {}, where))
    report_findings(library.warnings)
    try:
        return propose_errand(compile_scene(plan, ()))
    except ValueError as error:
        raise InputError.at(where, str(error)) from error


def _robot_file(robot: str, folder: Path) -> Path:
    """Return the file of a robot by its path or name; raises ``InputError``."""
    from daemon.campaign import ROBOT, LayerReference, find_layer

    is_path = "/" in robot or robot.endswith(ROBOT.endings)
    name = str(Path(robot).absolute()) if is_path else robot
    # From the folder above, because the new one does not exist yet.
    return find_layer(folder.parent, LayerReference(name, {}, Where("--robot")), ROBOT)


def _robot_reference(path: Path, folder: Path) -> str:
    """Return the reference to a robot in ``folder``: its name if it ships, else its path."""
    from grammars.text.sources import shipped_folder

    if path.resolve().is_relative_to(shipped_folder()):
        return path.stem
    return Path(os.path.relpath(path, folder)).as_posix()


def _layers(folder: Path) -> Iterator[NamedLayer]:
    """Iterate over the layers of a folder, then the shared ones, then those that ship.

    The first of several with the same name counts. Raises :class:`typer.BadParameter`.
    """
    from daemon.campaign import LAYER_KINDS, layer_names, layer_places
    from grammars.text.sources import shipped_folder

    if why := why_no_folder(folder):
        raise typer.BadParameter(f"{folder} {why}", param_hint="NAME")
    for kind in LAYER_KINDS:
        layers: dict[str, NamedLayer] = {}
        for place in layer_places(folder, kind):
            ships = kind.ships and place.resolve().is_relative_to(shipped_folder())
            for name in sorted(layer_names(place, kind)):
                path = place / f"{name}{kind.endings[0]}"
                about = _about(path) if kind.key else ""
                file = "" if ships else os.path.normpath(path)
                layers.setdefault(name, NamedLayer(kind.title, name, about, file, ships))
        yield from layers.values()


def _about(path: Path) -> str:
    """Return the description in a file, or why it cannot be read."""
    from grammars.text.documents import load_yaml

    try:
        about = load_yaml(path).data.get("about", "")
    except InputError as error:
        return f"cannot be read: {error.findings[0].message}"
    return about if isinstance(about, str) else ""


def _print_layers(listed: LayerList) -> None:
    from rich.text import Text

    table = plain_table("kind", "name", "about", "where")
    previous = ""
    for layer in listed.layers:
        kind = "" if layer.kind == previous else layer.kind
        where = "ships" if layer.ships else layer.file
        table.add_row(*map(Text, (kind, layer.name, layer.about, where)))
        previous = layer.kind
    stdout_console().print(table)
