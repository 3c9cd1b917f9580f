"""The artefacts there are, by name, and the one way in which they are made, singly or all at once.

A kind that cannot be made of what is given (a plan has no doors that move) is an error when it is
asked for by name and left out when all are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean
from templates.rendering import Templates
from templates.world import ArtefactWorld, ExportJob, ExportSettings

Needs: TypeAlias = Literal["plan", "scene", "campaign"]
ALL: Final = "all"


@dataclass(frozen=True, slots=True)
class ArtefactKind:
    """A kind of artefact: ``about`` for people, what it ``needs``, how it is made."""

    name: str
    about: str
    needs: Needs
    make: Callable[[ExportJob], Iterable[Path]]

    def fits(self, world: ArtefactWorld) -> bool:
        """Return whether ``world`` holds what this kind is made of."""
        if self.needs == "plan":
            return world.plan is not None
        return self.needs == "scene" or world.mission is not None


@dataclass(frozen=True, slots=True)
class ExportResult:
    """What an export left: files by kind, and notes on what could not be said in a format."""

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
    templates: Templates | None = None,
) -> ExportResult:
    """Make artefacts of ``kinds`` (names, or ``all``) of ``world`` in ``folder``.

    Provenance comes last, whatever the order asked for. Same input, same bytes. Raises
    :class:`InputError` for unknown kinds, for kinds ``world`` has not the parts of, and for
    templates that cannot be used.
    """
    chosen = choose_kinds(world, kinds)
    job = ExportJob(world, folder, settings or ExportSettings(), templates or Templates())
    folder.mkdir(parents=True, exist_ok=True)
    for kind in chosen:
        job.made[kind.name] = tuple(kind.make(job))
    return ExportResult(job.made, tuple(dict.fromkeys(job.notes)))


def choose_kinds(world: ArtefactWorld, names: Iterable[str]) -> tuple[ArtefactKind, ...]:
    """Return the kinds called ``names``, in the order they are made in."""
    wanted = list(names)
    unknown = [name for name in wanted if name not in KINDS and name != ALL]
    if unknown:
        hint = did_you_mean(unknown[0], (*KINDS, ALL))
        raise InputError.at(Where("export"), f'no artefact "{unknown[0]}"', hint)
    everything = ALL in wanted
    unfit = [KINDS[n] for n in wanted if n != ALL and not KINDS[n].fits(world)]
    if unfit and not everything:
        raise InputError(
            Diagnostic(
                Where("export"),
                f"{kind.name} cannot be made of {world.name}",
                "give a floor plan (.fpm)" if kind.needs == "plan" else "give a campaign (.yaml)",
            )
            for kind in unfit
        )
    return tuple(
        kind for kind in KINDS.values() if (everything or kind.name in wanted) and kind.fits(world)
    )


def _geojson(job: ExportJob) -> Iterable[Path]:
    from templates.maps import write_geojson

    plan = job.world.plan
    return (write_geojson(plan, job.path(f"{job.name}.geojson")),) if plan else ()


def _jsonld(job: ExportJob) -> Iterable[Path]:
    from templates.jsonld import write_jsonld

    plan = job.world.plan
    return write_jsonld(plan, job.path("jsonld"), job.world.layers) if plan else ()


def _map(job: ExportJob) -> Iterable[Path]:
    from templates.maps import write_maps

    return write_maps(job)


def _mesh(job: ExportJob) -> Iterable[Path]:
    from templates.mesh import wall_mesh, write_glb, write_stl

    if not job.world.scene.solids:
        job.notes.append("nothing stands here: there is no mesh")
        return ()
    mesh = job.once("mesh", lambda: wall_mesh(job.world.scene))
    stl, glb = (job.path("mesh", f"{job.building}.{ending}") for ending in ("stl", "glb"))
    return write_stl(mesh, stl), write_glb(mesh, glb, name=job.building)


def _sdf(job: ExportJob) -> Iterable[Path]:
    from templates.sdf import write_sdf

    return write_sdf(job)


def _keyframes(job: ExportJob) -> Iterable[Path]:
    from templates.sdf import write_keyframes

    return write_keyframes(job)


def _tasks(job: ExportJob) -> Iterable[Path]:
    from templates.tasks import write_tasks

    return write_tasks(job)


def _launch(job: ExportJob) -> Iterable[Path]:
    from templates.launch import write_launch

    return write_launch(job)


def _foxglove(job: ExportJob) -> Iterable[Path]:
    from templates.launch import write_layout

    return write_layout(job)


def _picture(job: ExportJob) -> Iterable[Path]:
    from templates.picture import write_picture

    return write_picture(job)


def _prov(job: ExportJob) -> Iterable[Path]:
    from templates.provenance import write_provenance

    return write_provenance(job)


KINDS: Final = {
    kind.name: kind
    for kind in (
        ArtefactKind("geojson", "the plan as 2D geometry", "plan", _geojson),
        ArtefactKind(
            "jsonld",
            "the composable model: plan in six files and in one, scenery layers",
            "plan",
            _jsonld,
        ),
        ArtefactKind(
            "map", "occupancy grids for ROS, .pgm and .yaml, per state of the doors", "scene", _map
        ),
        ArtefactKind("mesh", "walls as one watertight mesh, .stl and .glb", "scene", _mesh),
        ArtefactKind("sdf", "Gazebo models and worlds, gz-sim and Classic", "scene", _sdf),
        ArtefactKind(
            "keyframes", "doors that move at given times, as JSON", "campaign", _keyframes
        ),
        ArtefactKind(
            "tasks", "waypoints around every space, and the mission, as YAML", "scene", _tasks
        ),
        ArtefactKind("launch", "launch files for ROS 1 and ROS 2", "scene", _launch),
        ArtefactKind("foxglove", "a layout for Foxglove", "scene", _foxglove),
        ArtefactKind(
            "picture", "plan, doors, waypoints and robot, .svg and .png", "scene", _picture
        ),
        ArtefactKind("prov", "where all of it comes from, W3C PROV", "scene", _prov),
    )
}
"""Every kind by name, in the order they are made: the last one tells of all before it."""
