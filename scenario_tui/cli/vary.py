"""The command that makes variants of a floor plan."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.completion import variation_files
from scenario_tui.cli.exit_codes import wrong_usage
from scenario_tui.cli.options import AsJson
from scenario_tui.cli.output import (
    Output,
    OutputPart,
    plain_table,
    report_findings,
    say,
    stdout_console,
)

if TYPE_CHECKING:
    from rich.table import Table

    from grammars.variation import Variant, VariantFile, VariantValue

_DEFAULT_NUMBER: Final = 10


class SamplingMethod(StrEnum):
    """How the values of the variants are chosen."""

    RANDOM = "random"
    GRID = "grid"
    HALTON = "halton"
    LHS = "lhs"


class DrawnValue(OutputPart):
    """A value that was drawn."""

    name: str
    value: float
    unit: str


class MadeVariant(OutputPart):
    """A variant, and what became of its file."""

    file: str
    outcome: str
    seed: int
    tries: int
    values: list[DrawnValue]

    @classmethod
    def of(cls, entry: VariantFile) -> MadeVariant:
        """Return a variant as it is written."""
        made = entry.variant
        values = [DrawnValue(v.name, v.number, v.unit) for v in made.values]
        return cls(str(entry.path), entry.outcome, made.seed, made.tries, values)


class VaryOutput(Output, schema="vary"):
    """The variants of a floor plan."""

    variation: str
    plan: str
    method: str
    seed: int
    variants: list[MadeVariant]


def vary(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.variation",
            help="What to vary, and how.",
            autocompletion=completion.files(variation_files),
        ),
    ],
    number: Annotated[
        int | None,
        typer.Option(
            "--number",
            "-n",
            min=1,
            max=100_000,
            help=f"Variants to make. Default: {_DEFAULT_NUMBER}; a grid: all it has.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=2**32 - 1, help="Seed of the first variant; they count up.")
    ] = 0,
    method: Annotated[
        SamplingMethod,
        typer.Option(
            help="random: draw each by its seed. grid: every combination. halton, lhs: fill the "
            "space evenly."
        ),
    ] = SamplingMethod.RANDOM,
    levels: Annotated[int, typer.Option(min=1, max=100, help="Values per range of a grid.")] = 3,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.")
    ] = Path(),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files that exist, instead of keeping them.")
    ] = False,
    suffix: Annotated[
        bool, typer.Option("--suffix", help="Write the seed into the name of each plan.")
    ] = False,
    check: Annotated[
        float | None,
        typer.Option(
            min=0.01,
            max=100.0,
            metavar="RADIUS",
            help="Only sound plans: no rooms that overlap, openings inside of their walls, and a "
            "robot of this radius, in metres, reaches every space.",
        ),
    ] = None,
    tries: Annotated[
        int, typer.Option(min=1, max=1_000_000, help="Draws per variant before giving up.")
    ] = 200,
    as_json: AsJson = False,
) -> None:
    """Write variants of a floor plan, drawn from distributions."""
    from grammars.variation import load_variation, sample, source_defects, write_variants

    source = load_variation(file)
    report_findings(source.warnings)
    if check is not None:
        report_findings(source_defects(source, check))
    # A grid has an end of its own; the others could go on for ever.
    if number is None and method is not SamplingMethod.GRID:
        number = _DEFAULT_NUMBER
    with wrong_usage():
        variants = sample(
            source,
            number,
            seed=seed,
            method=method.value,
            levels=levels,
            tries=tries,
            check=check,
            suffix=suffix,
        )
    written = write_variants(variants, out, overwrite=overwrite, source=source.plan_file)
    if as_json:
        made = [MadeVariant.of(entry) for entry in written]
        VaryOutput(source.file, str(source.plan_file), method.value, seed, made).emit()
    else:
        for table in _tables(written):
            stdout_console().print(table)
    say(_summary(written, out))
    # A plan may have defects of its own: only more than those are the variant's.
    if check is None:
        doubtful = sum(len(v.plan.warnings) > len(source.source.warnings) for v in variants)
        if doubtful:
            say(f"{doubtful} of them may not be sound: --check RADIUS makes only sound ones")


def _tables(written: tuple[VariantFile, ...]) -> list[Table]:
    """Return what the columns are, and the values of every variant."""
    from rich.table import Table
    from rich.text import Text

    names = Table(box=None, show_header=False, pad_edge=False)
    values = plain_table("file")
    values.columns[0].no_wrap = True
    for index, value in enumerate(written[0].variant.values):
        names.add_row(
            _column_name(index), value.name, Text(f"[{value.unit}]" if value.unit else "")
        )
        values.add_column(_column_name(index), justify="right", overflow="fold")
    values.add_column("")
    for entry in written:
        numbers = [_number(v) for v in entry.variant.values]
        values.add_row(entry.path.name, *numbers, _remark(entry.variant, entry.outcome))
    return [names, Table.grid(), values]


def _number(value: VariantValue) -> str:
    return f"{value.number:.6g}".replace("-", "−")


def _remark(variant: Variant, outcome: str) -> str:
    """Return what is worth a word: a file that was there, draws that were rejected."""
    found = [] if outcome == "written" else [outcome]
    if variant.tries > 1:
        found.append(f"draw {variant.tries}")
    return ", ".join(found)


def _column_name(index: int) -> str:
    """Return a, b, … z, aa, ab, … as in a spreadsheet."""
    name = ""
    index += 1
    while index:
        index, digit = divmod(index - 1, 26)
        name = chr(ord("a") + digit) + name
    return name


def _summary(written: tuple[VariantFile, ...], folder: Path) -> str:
    from grammars.text.words import count_noun

    outcomes = [entry.outcome for entry in written]
    new = len(outcomes) - outcomes.count("kept") - outcomes.count("unchanged")
    words = [f"{count_noun(new, 'plan')} written to {folder}"]
    if "unchanged" in outcomes:
        words.append(f"{outcomes.count('unchanged')} there already")
    if "kept" in outcomes:
        words.append(f"{outcomes.count('kept')} kept as they were: --overwrite replaces them")
    return "; ".join(words)
