"""What a campaign names and nobody uses: layers, oracles, groups, parameters, scenarios."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from daemon.campaign._cells import CampaignCell, Draft
from daemon.campaign._file import SlotsText
from daemon.campaign._names import layer_name
from daemon.campaign._scenarios import LayerReference, bases_of
from grammars.scenery import unused_groups, unused_parameters
from grammars.scenery.composition import Catalogue
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where
from grammars.text.sources import not_recording, read_text


def find_unused(draft: Draft) -> list[Diagnostic]:
    """Return warnings about what is written and has no effect on any run of a campaign."""
    found = [
        *_parameters(draft.cells),
        *_members(draft.cells),
        *_abstract_scenarios(draft),
        *_slots(draft),
        *_replaced_everywhere(draft),
        *_plans_of_variants(draft),
        *_oracles(draft),
        *_groups(draft.cells),
        *_without_effect(draft),
    ]
    return list(dict.fromkeys(found))


_ONE_OF_BOTH: Final = "leave it out here, or there"


def _warning(where: Where, message: str, hint: str) -> Diagnostic:
    return Diagnostic(where, message, hint, Severity.WARNING)


def _abstract_scenarios(draft: Draft) -> Iterator[Diagnostic]:
    bases = {scenario.like for scenario in draft.text.scenarios.values()}
    for name, scenario in draft.text.scenarios.items():
        if scenario.abstract and name not in bases:
            where = draft.document.where(("scenarios", name))
            message = f'scenario "{name}" is abstract and no other one is like it'
            yield _warning(where, message, "leave it out, or leave out abstract")


def _slots(draft: Draft) -> Iterator[Diagnostic]:
    """Yield the robot and the systems of the whole campaign that every scenario replaces."""
    text, defaults = draft.text, draft.text.defaults
    robots = {s.robot.where for s in draft.scenarios.values() if s.robot}
    for robot, path in ((text.robot, ("robot",)), (defaults.robot, ("defaults", "robot"))):
        where = draft.document.where(path)
        if robot is not None and where not in robots:
            message = f"no scenario uses the robot {layer_name(robot)}, each names another"
            yield _warning(where, message, _ONE_OF_BOTH)
    suts = {reference.where for s in draft.scenarios.values() for reference in s.suts}
    matrix = text.matrix.sut if text.matrix else []
    for names, path in ((matrix, ("matrix", "sut")), (defaults.sut or [], ("defaults", "sut"))):
        for index, name in enumerate(names):
            where = draft.document.where((*path, index))
            if where not in suts:
                named = layer_name(name)
                message = f"no scenario uses the system under test {named}, each names others"
                yield _warning(where, message, _ONE_OF_BOTH)


_AT_THE_TOP: Final = frozenset({"map", "vary", "chance"})
"""Keys that may stand at the top, below ``defaults`` and in scenarios; without the limit, which a
campaign must have at the top, and the robot, which is told by its name."""


def _replaced_everywhere(draft: Draft) -> Iterator[Diagnostic]:
    """Yield what is said for all scenarios and replaced in each of them."""
    text, slots = draft.text, draft.text.scenarios
    chains = [
        [slots[n] for n in (s.name, *bases_of(s.name, text))] for s in draft.scenarios.values()
    ]
    for path, said, keys in (
        ((), text, _AT_THE_TOP),
        (("defaults",), text.defaults, SlotsText.model_fields.keys() - {"robot", "sut"}),
    ):
        over = [[text.defaults, *chain] for chain in chains] if said is text else chains
        for key in sorted(keys & said.model_fields_set):
            if all(any(getattr(one, key) is not None for one in chain) for chain in over):
                message = f"no scenario uses the {key} said for all, each has another"
                yield _warning(draft.document.where((*path, key)), message, _ONE_OF_BOTH)


def _plans_of_variants(draft: Draft) -> Iterator[Diagnostic]:
    # A plan beside variants from elsewhere waits for these to be switched off.
    defaults: tuple[tuple[str, ...], SlotsText] = (("defaults",), draft.text.defaults)
    scenarios = ((("scenarios", name), text) for name, text in draft.text.scenarios.items())
    for path, slots in (defaults, *scenarios):
        if slots.vary is not None and slots.floorplan is not None:
            where = draft.document.where((*path, "floorplan"))
            message = f"not used: the plans are variants of {layer_name(slots.vary.floorplan)}"
            yield _warning(where, message, 'leave out "floorplan", or "vary"')


def _oracles(draft: Draft) -> Iterator[Diagnostic]:
    used = {reference.name for s in draft.scenarios.values() for reference in s.oracles}
    for index, name in enumerate(draft.text.oracles or []):
        where = draft.document.where(("oracles", index))
        found = draft.library.oracles((LayerReference(name, {}, where),))
        if used.isdisjoint(found):
            message = f"no scenario uses an oracle of {name}"
            hint = f"its oracles: {', '.join(found)}; each scenario picks some: oracles: […]"
            yield _warning(where, message, hint)
            continue
        # A measure costs nothing to have at hand; a limit that judges nothing is forgotten.
        idle = {o.name: o.where for o in found.values() if not o.is_measure and o.name not in used}
        if idle and not _is_shared(name, Path(draft.document.file)):
            for oracle, place in idle.items():
                hint = f"name it in a scenario (oracles: [{oracle}]), or leave it out"
                yield _warning(place, f"no scenario uses the oracle {oracle}", hint)


def _is_shared(layer: str, campaign: Path) -> bool:
    """Return whether a layer may be made for other campaigns as well.

    It is when it lies elsewhere or another campaign beside this one names it.
    """
    if "/" in layer or not any(campaign.parent.glob(f"{layer}*")):
        return True
    word = re.compile(rf"(?<![\w.-]){re.escape(layer)}(?![\w-])")
    others = (p for p in campaign.parent.glob("*.y*ml") if p.name != campaign.name)
    return any(
        re.search(r"^campaign\s*:", text, re.MULTILINE) and word.search(text)
        for text in map(_text_of, others)
    )


def _text_of(path: Path) -> str:
    try:
        # What other campaigns name decides about a warning, and about nothing that is run.
        with not_recording():
            return read_text(path)
    except InputError:
        # A folder or a pipe of such a name is no campaign: it names nothing.
        return ""


def _parameters(cells: Iterable[CampaignCell]) -> Iterator[Diagnostic]:
    for layer in dict.fromkeys(layer for cell in cells for layer in cell.layers):
        yield from unused_parameters(layer)


def _groups(cells: Sequence[CampaignCell]) -> Iterator[Diagnostic]:
    """Yield groups that are used in none of the cells their layer is part of."""
    for layer in {layer.file: layer for cell in cells for layer in cell.layers}.values():
        beside = [c.layers for c in cells if any(other.file == layer.file for other in c.layers)]
        yield from unused_groups(layer, [other for layers in beside for other in layers])


def _members(cells: Iterable[CampaignCell]) -> Iterator[Diagnostic]:
    """Yield members of groups that are there in none of the cells of their layer."""
    stacks = dict.fromkeys(cell.layers for cell in cells)
    lacking = {layers: Catalogue(layers).unknown_members() for layers in stacks}
    for problem in dict.fromkeys(p for problems in lacking.values() for p in problems):
        file = problem.where.file
        with_it = [layers for layers in stacks if any(layer.file == file for layer in layers)]
        # Another scenario may have the members that this one lacks.
        if all(problem in lacking[layers] for layers in with_it):
            yield problem


def _without_effect(draft: Draft) -> Iterator[Diagnostic]:
    """Yield the names of scenery layers that change nothing wherever they are named."""
    acting = {file for cell in draft.cells for file in _acting(cell)}
    known = {layer.file for cell in draft.cells for layer in cell.layers}
    for scenario in draft.scenarios.values():
        for reference in (*scenario.objects, *scenario.behaviours):
            file = _file_of(reference, known)
            if file is not None and file not in acting:
                yield _warning(
                    reference.where,
                    f"{reference.name} changes nothing: it places no object, and what its "
                    "sentences say is replaced by later layers or about no object",
                    "leave it out, or name it after the layer it is to replace",
                )


def _file_of(reference: LayerReference, files: Iterable[str]) -> str | None:
    stem = Path(reference.name).name
    found = [file for file in files if Path(file).name.split(".")[0] == stem.split(".")[0]]
    return found[0] if len(found) == 1 else None


def _acting(cell: CampaignCell) -> Iterator[str]:
    """Yield the files of the layers that have a part in a cell."""
    deciding = set(cell.places.values())
    models = {i.model.text for layer in cell.layers for i in layer.instances}
    for layer in cell.layers:
        says = any(sentence.where in deciding for sentence in layer.sentences)
        places = layer.instances or layer.settings or (layer.groups and not layer.sentences)
        if says or places or any(model.name in models for model in layer.models):
            yield layer.file
