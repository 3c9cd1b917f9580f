"""Writing variants to files."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from grammars.diagnostics import Diagnostic, InputError, Where
from grammars.variation._model import Variant


@dataclass(frozen=True, slots=True)
class Written:
    """What became of one variant's file: new, replaced, the same already, or kept as it was."""

    path: Path
    variant: Variant
    outcome: Literal["written", "overwritten", "unchanged", "kept"]


def write_variants(
    variants: Iterable[Variant],
    folder: str | Path,
    *,
    overwrite: bool = False,
    source: str | Path | None = None,
) -> tuple[Written, ...]:
    """Write every variant to ``<folder>/<plan>_<seed>.fpm``; the folder is made when missing.

    Files that exist are kept unless ``overwrite``; ``source``, the plan the variants come from, is
    never overwritten. Raises :class:`InputError` when a file cannot be written.
    """
    directory = Path(folder)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return tuple(_write(v, directory, overwrite, source) for v in variants)
    except OSError as error:
        reason = error.strerror or str(error)
        place = Where(str(error.filename or directory))
        raise InputError(Diagnostic(place, f"cannot be written: {reason}")) from error


def _write(
    variant: Variant, directory: Path, overwrite: bool, source: str | Path | None
) -> Written:
    path = directory / f"{variant.name}.fpm"
    data = variant.text.encode()
    existed = path.exists()
    if existed:
        if path.read_bytes() == data:
            return Written(path, variant, "unchanged")
        if source is not None and path.samefile(source):
            message = "is the plan itself and is not overwritten"
            raise InputError(Diagnostic(Where(str(path)), message, "take another folder or seed"))
        if not overwrite:
            return Written(path, variant, "kept")
    # Written beside and renamed: nobody ever reads half a plan.
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.write_bytes(data)
    unfinished.replace(path)
    return Written(path, variant, "overwritten" if existed else "written")
