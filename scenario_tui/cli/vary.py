"""The command that makes variants of a floor plan."""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from grammars.text.words import count_noun
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, wrong_usage
from scenario_tui.cli.options import out_folder
from scenario_tui.cli.output import plain_table, report_findings, say, stdout_console

if TYPE_CHECKING:
    from rich.table import Table

    from grammars.variation import VariantFile, WrittenVariants

_DEFAULT_NUMBER: Final = 10


def vary(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.variation",
            help="Description of the variation.",
            autocompletion=completion.offers(completion.files(".variation")),
        ),
    ],
    number: Annotated[
        int | None,
        typer.Option(
            "-n",
            min=1,
            max=100_000,
            help=f"Number of variants. Default: {_DEFAULT_NUMBER}; for a grid: all.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=2**32 - 1, help="Seed of the first variant; others count up.")
    ] = 0,
    method: Annotated[
        Literal["random", "grid", "halton", "lhs"],
        "random: draw each by its seed. grid: every combination. halton, lhs: cover the "
        "space evenly.",
    ] = "random",
    levels: Annotated[int, typer.Option(min=1, max=100, help="Values per range of a grid.")] = 3,
    out: Annotated[Path, out_folder("Folder to write to.")] = Path(),
    overwrite: Annotated[bool, "Replace existing files instead of keeping them."] = False,
    suffix: Annotated[bool, "Write the seed into the name of each plan."] = False,
    check: Annotated[
        float | None,
        typer.Option(
            min=0.01,
            max=100.0,
            metavar="RADIUS",
            help="Make only sound plans: no overlapping rooms, openings inside their walls, and "
            "every space within reach of a robot of this radius, metres.",
        ),
    ] = None,
    tries: Annotated[int, typer.Option(min=1, max=1_000_000, help="Most draws per variant.")] = 200,
) -> Answer[WrittenVariants]:
    """Write variants of a floor plan, drawn from distributions."""
    from grammars.variation import (
        WrittenVariants,
        load_variation,
        sample,
        source_defects,
        write_variants,
    )

    source = load_variation(file)
    report_findings(source.warnings)
    if check is not None:
        report_findings(source_defects(source, check))
    # A grid is finite; the other methods are not.
    if number is None and method != "grid":
        number = _DEFAULT_NUMBER
    with wrong_usage():
        variants = sample(
            source,
            number,
            seed=seed,
            method=method,
            levels=levels,
            tries=tries,
            check=check,
            suffix=suffix,
        )
    files = write_variants(variants, out, overwrite=overwrite, source=source.plan_file)
    # The plan itself may have defects: only further ones come from a variant.
    defects = len(source.source.warnings)
    doubtful = sum(len(one.plan.warnings) > defects for one in variants) if check is None else 0
    value = WrittenVariants(source.file, source.plan_file, files)
    return Answer("vary", value, partial(_print, value, out, doubtful))


def _print(value: WrittenVariants, folder: Path, doubtful: int) -> None:
    for table in _tables(value.variants):
        stdout_console().print(table)
    say(_summary(value.variants, folder))
    if doubtful:
        say(f"{doubtful} of them may not be sound; --check RADIUS makes only sound ones")


def _tables(files: tuple[VariantFile, ...]) -> list[Table]:
    """Return tables with the names of columns and the values of every variant."""
    from rich.table import Table
    from rich.text import Text

    names = Table(box=None, show_header=False, pad_edge=False)
    values = plain_table("file")
    values.columns[0].no_wrap = True
    for index, value in enumerate(files[0].values):
        names.add_row(
            _column_name(index), value.name, Text(f"[{value.unit}]" if value.unit else "")
        )
        values.add_column(_column_name(index), justify="right", overflow="fold")
    values.add_column("")
    for one in files:
        numbers = [f"{v.number:.6g}".replace("-", "−") for v in one.values]
        values.add_row(one.path.name, *numbers, _remark(one))
    return [names, Table.grid(), values]


def _remark(file: VariantFile) -> str:
    """Return an unusual outcome, and the number of draws if there were several."""
    remarks: list[str] = [] if file.outcome == "written" else [file.outcome]
    if file.tries > 1:
        remarks.append(f"draw {file.tries}")
    return ", ".join(remarks)


def _column_name(index: int) -> str:
    """Return a, b, … z, aa, ab, … as in a spreadsheet."""
    name = ""
    index += 1
    while index:
        index, digit = divmod(index - 1, 26)
        name = chr(ord("a") + digit) + name
    return name


def _summary(files: tuple[VariantFile, ...], folder: Path) -> str:
    counts = Counter(one.outcome for one in files)
    new = counts["written"] + counts["overwritten"]
    parts = [f"{count_noun(new, 'plan')} written to {folder}"]
    if counts["unchanged"]:
        parts.append(f"{counts['unchanged']} unchanged")
    if counts["kept"]:
        parts.append(f"{counts['kept']} existing ones kept: --overwrite replaces them")
    return "; ".join(parts)
