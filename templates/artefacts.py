"""Kinds of artefacts by name, and the one way to make them, singly or all at once.

A kind that cannot be made of what is given (a plan has no doors that move), or takes a library that
is not installed, is an error when it is asked for by name and left out when all are asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean
from grammars.text.plugins import MissingExtraError
from templates.world import ArtefactWorld, ExportJob, ExportSettings

Needs: TypeAlias = Literal["plan", "scene", "campaign"]
ALL: Final = "all"


@dataclass(frozen=True, slots=True)
class ArtefactKind:
    """A kind of artefact: ``about`` for people, what it ``needs``, its ``maker`` in templates."""

    name: str
    about: str
    needs: Needs
    maker: str

    def fits(self, world: ArtefactWorld) -> bool:
        """Return whether ``world`` holds what this kind is made of."""
        if self.needs == "plan":
            return world.plan is not None
        return self.needs == "scene" or world.mission is not None

    def make(self, job: ExportJob) -> tuple[Path, ...]:
        """Make artefacts of this kind and return their files."""
        module, _, name = self.maker.partition(":")
        return tuple(getattr(importlib.import_module(f"templates.{module}"), name)(job))


@dataclass(frozen=True, slots=True)
class ExportResult:
    """Files of an export by kind, and notes on facts that a format cannot hold."""

    made: dict[str, tuple[Path, ...]]
    notes: tuple[str, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        """Every file, in the order they were made."""
        return tuple(path for paths in self.made.values() for path in paths)


def export(
    world: ArtefactWorld,
    kinds: Iterable[str],
    folder: Path,
    *,
    settings: ExportSettings | None = None,
) -> ExportResult:
    """Make artefacts of ``kinds`` (names, or ``all``) of ``world`` in ``folder``.

    Provenance comes last, whatever the order asked for. Same input, same bytes. Raises
    :class:`InputError` for unknown kinds, for kinds ``world`` has not the parts of, for libraries
    that are not installed.
    """
    names = tuple(kinds)
    folder.mkdir(parents=True, exist_ok=True)
    job = ExportJob(world, folder, settings or ExportSettings())
    for kind in choose_kinds(world, names):
        try:
            job.made[kind.name] = kind.make(job)
        except MissingExtraError as error:
            if kind.name in names:
                raise
            job.notes += (f"{d.message}; {d.hint}" for d in error.findings)
    return ExportResult(job.made, tuple(dict.fromkeys(job.notes)))


def choose_kinds(world: ArtefactWorld, names: Iterable[str]) -> tuple[ArtefactKind, ...]:
    """Return the kinds called ``names``, in the order they are made in."""
    asked = list(names)
    unknown = [name for name in asked if name not in KINDS and name != ALL]
    if unknown:
        hint = did_you_mean(unknown[0], (*KINDS, ALL))
        raise InputError.at(Where("export"), f'no artefact "{unknown[0]}"', hint)
    everything = ALL in asked
    unfit = [KINDS[n] for n in asked if n != ALL and not KINDS[n].fits(world)]
    if unfit and not everything:
        raise InputError(
            Finding(
                Where("export"),
                f"{kind.name} cannot be made of {world.name}",
                "give a floor plan (.fpm)" if kind.needs == "plan" else "give a campaign (.yaml)",
            )
            for kind in unfit
        )
    return tuple(
        kind for kind in KINDS.values() if (everything or kind.name in asked) and kind.fits(world)
    )


# Makers are named, not imported: one kind needs shapely, another jinja2 or the mesh extra, and who
# asks for a map loads none of the others.
KINDS: Final = {
    kind.name: kind
    for kind in (
        ArtefactKind(
            "jsonld",
            "the composable model: plan in six files and in one, scenery layers",
            "plan",
            "jsonld:export_jsonld",
        ),
        ArtefactKind(
            "map",
            "occupancy grids for ROS, .pgm and .yaml, per state of the doors",
            "scene",
            "maps:write_maps",
        ),
        ArtefactKind(
            "mesh", "walls as one watertight mesh, .stl and .glb", "scene", "mesh:write_meshes"
        ),
        ArtefactKind(
            "sdf", "Gazebo models and worlds, gz-sim and Classic", "scene", "sdf:write_sdf"
        ),
        ArtefactKind(
            "keyframes",
            "doors that move at given times, as JSON",
            "campaign",
            "sdf:write_keyframes",
        ),
        ArtefactKind(
            "tasks",
            "waypoints around every space, and the mission, as YAML",
            "scene",
            "tasks:write_tasks",
        ),
        ArtefactKind("launch", "launch files for ROS 1 and ROS 2", "scene", "launch:write_launch"),
        ArtefactKind("foxglove", "a layout for Foxglove", "scene", "launch:write_layout"),
        ArtefactKind(
            "picture",
            "plan, doors, waypoints and robot, .svg and .png",
            "scene",
            "picture:write_picture",
        ),
        ArtefactKind(
            "prov",
            "where all of it comes from, W3C PROV",
            "scene",
            "provenance:write_provenance",
        ),
    )
}
"""Every kind by name, in the order they are made: the last one tells of all before it."""
