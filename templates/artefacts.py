"""Kinds of artefacts by name, and their export, singly or all at once.

A kind may need more than the world contains, or a library that is not installed. This is an error
if the kind is requested by name; an export of all kinds omits it.
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
    """Kind of artefact with a description, its requirements, and its ``maker`` in templates."""

    name: str
    about: str
    needs: Needs
    maker: str

    def fits(self, world: ArtefactWorld) -> bool:
        """Return whether ``world`` fulfils the requirements of this kind."""
        if self.needs == "plan":
            return world.plan is not None
        return self.needs == "scene" or world.mission is not None

    def make(self, job: ExportJob) -> tuple[Path, ...]:
        """Make artefacts of this kind and return their files."""
        module, _, name = self.maker.partition(":")
        return tuple(getattr(importlib.import_module(f"templates.{module}"), name)(job))


@dataclass(frozen=True, slots=True)
class ExportResult:
    """Files of an export by kind, and notes on facts that a format cannot express."""

    files: dict[str, tuple[Path, ...]]
    notes: tuple[str, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files in the order of their creation."""
        return tuple(path for paths in self.files.values() for path in paths)


def export(
    world: ArtefactWorld,
    kinds: Iterable[str],
    folder: Path,
    *,
    settings: ExportSettings | None = None,
) -> ExportResult:
    """Make artefacts of ``kinds`` (names, or ``all``) of ``world`` in ``folder``.

    Provenance always comes last. Equal inputs give equal bytes. Raises :class:`InputError` for
    unknown kinds, for kinds that do not fit ``world``, and for missing libraries.
    """
    names = tuple(kinds)
    folder.mkdir(parents=True, exist_ok=True)
    job = ExportJob(world, folder, settings or ExportSettings())
    for kind in choose_kinds(world, names):
        try:
            job.files[kind.name] = kind.make(job)
        except MissingExtraError as error:
            if kind.name in names:
                raise
            job.notes += (f"{d.message}; {d.hint}" for d in error.findings)
    return ExportResult(job.files, tuple(dict.fromkeys(job.notes)))


def choose_kinds(world: ArtefactWorld, names: Iterable[str]) -> tuple[ArtefactKind, ...]:
    """Return the kinds called ``names``, in the order of their creation."""
    requested = list(names)
    unknown = [name for name in requested if name not in KINDS and name != ALL]
    if unknown:
        hint = did_you_mean(unknown[0], (*KINDS, ALL))
        raise InputError.at(Where("export"), f'no artefact "{unknown[0]}"', hint)
    everything = ALL in requested
    unfitting = [KINDS[n] for n in requested if n != ALL and not KINDS[n].fits(world)]
    if unfitting and not everything:
        raise InputError(
            Finding(
                Where("export"),
                f"{kind.name} cannot be made of {world.name}",
                "give a floor plan (.fpm)" if kind.needs == "plan" else "give a campaign (.yaml)",
            )
            for kind in unfitting
        )
    return tuple(
        kind
        for kind in KINDS.values()
        if (everything or kind.name in requested) and kind.fits(world)
    )


# Makers are named, not imported: some need shapely, others jinja2 or the mesh extra. An export of a
# map loads none of the others.
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
            "provenance of all files, W3C PROV",
            "scene",
            "provenance:write_provenance",
        ),
    )
}
"""All kinds by name, in the order of their creation: the last one describes all others."""
