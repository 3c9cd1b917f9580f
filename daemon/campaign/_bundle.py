"""The files that a campaign is made of, as one value that can be sent and unpacked elsewhere.

Everything that loading the campaign reads is in it, what ships included: another machine may have
another version. Nothing else is: neighbours that only warnings are about stay where they are.
"""

from __future__ import annotations

import base64
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from daemon.campaign._campaign import Campaign, expand
from daemon.campaign._loader import load_campaign
from daemon.model.bundles import MOST_FILES, unpack_bundle
from daemon.model.search import LARGEST_BUNDLE, BundledFile
from grammars.text.diagnostics import InputError, Where
from grammars.text.shipped import shipped_folder
from grammars.text.sources import reading_only_in, reason_of, recording_reads

_FARTHEST: Final = 3
"""So many folders above that of the campaign may files lie that it names."""


def bundle_campaign(path: str | Path) -> tuple[str, tuple[BundledFile, ...]]:
    """Return the path of a campaign file among the files that loading it reads, and these files.

    Paths are relative to the folder that all of them have in common; shipped layers lie where the
    campaign finds them first. The bundle is unpacked and loaded before it is returned: it means
    the same runs. Raises :class:`InputError` for a campaign that cannot be loaded, and for files
    that cannot be handed on: too large, too many, named by a path that is none elsewhere.
    """
    # Its folder without links: ".." of a link leads elsewhere than its text says.
    file = Path(path).parent.resolve() / Path(path).name
    with recording_reads() as read:
        campaign = load_campaign(file)
    places = _places(file, read)
    _refuse_oversized(file, places)
    files = tuple(
        BundledFile(place, base64.b64encode(_content(source)).decode("ascii"))
        for place, source in sorted(places.items())
    )
    name = next(place for place, source in places.items() if source == file)
    _verify(file, name, files, campaign)
    return name, files


def _places(campaign: Path, read: Iterable[Path]) -> dict[str, Path]:
    """Return the files by their paths in the bundle; raises :class:`InputError`."""
    shipped = shipped_folder()
    own = campaign.parent.is_relative_to(shipped)
    from_here: list[Path] = []
    from_shipped: list[Path] = []
    for path in dict.fromkeys((campaign, *read)):
        place = Path(os.path.normpath(path.absolute()))
        if not _is_same(place, path):
            message = f"{path} cannot be handed on: its path leads behind a link"
            raise InputError.at(Where(str(campaign)), message, "name it without ..")
        # In a checkout the shipped campaigns are files like others.
        ships = not own and place.is_relative_to(shipped)
        (from_shipped if ships else from_here).append(place)
    root = Path(os.path.commonpath([place.parent for place in from_here]))
    if len(campaign.parent.relative_to(root).parts) > _FARTHEST:
        far = max(from_here, key=lambda place: len(_above(campaign.parent, place)))
        message = f"{far} cannot be handed on with the campaign: it lies too far from it"
        raise InputError.at(Where(str(campaign)), message, "put it near the campaign file")
    found = {place.relative_to(root).as_posix(): place for place in dict.fromkeys(from_here)}
    beside = campaign.parent.relative_to(root)
    for place in dict.fromkeys(from_shipped):
        name = (beside / place.relative_to(shipped)).as_posix()
        if name in found:
            message = f"{place} cannot be handed on: {found[name]} has its place"
            raise InputError.at(Where(str(campaign)), message, "give your file another name")
        found[name] = place
    return found


def _above(folder: Path, place: Path) -> tuple[str, ...]:
    """Return the part of a folder's path that it does not share with a place."""
    return folder.relative_to(os.path.commonpath([folder, place.parent])).parts


def _is_same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False


def _content(source: Path) -> bytes:
    try:
        return source.read_bytes()
    except OSError as error:
        raise InputError.at(Where(str(source)), f"cannot be read: {reason_of(error)}") from error


def _refuse_oversized(campaign: Path, places: dict[str, Path]) -> None:
    if len(places) > MOST_FILES:
        message = f"it is made of {len(places)} files, {MOST_FILES} can be handed on"
        raise InputError.at(Where(str(campaign)), message)
    sizes = {place: source.stat().st_size for place, source in places.items()}
    total = sum(sizes.values())
    if total > LARGEST_BUNDLE:
        largest = max(sizes, key=lambda place: sizes[place])
        message = (
            f"its files have {total / 2**20:.0f} MiB, {LARGEST_BUNDLE >> 20} can be handed on; "
            f"the largest is {largest} with {sizes[largest] / 2**20:.0f}"
        )
        raise InputError.at(Where(str(campaign)), message, "leave out what the campaign can spare")


def _verify(campaign: Path, name: str, files: Sequence[BundledFile], wanted: Campaign) -> None:
    """Hold the bundle to specifying the runs of the campaign, without any file from around it."""
    with tempfile.TemporaryDirectory(prefix="scenario-bundle-") as parent:
        folder = Path(parent) / "files"
        unpack_bundle(files, folder)
        try:
            with reading_only_in(folder):
                unpacked = load_campaign(folder / name)
        except InputError as error:
            first = error.diagnostics[0]
            said = first.message.replace(f"{folder}/", "")
            message = f"cannot be handed on: elsewhere {said}"
            hint = "name files by paths relative to the campaign file"
            raise InputError.at(Where(str(campaign)), message, hint) from error
    if _digests(unpacked) != _digests(wanted) or unpacked.searches != wanted.searches:
        message = "cannot be handed on: its files mean other runs elsewhere"
        hint = "name files by paths relative to the campaign file"
        raise InputError.at(Where(str(campaign)), message, hint)


def _digests(campaign: Campaign) -> tuple[str, ...]:
    return expand(campaign).digests
