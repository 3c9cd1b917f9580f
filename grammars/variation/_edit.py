"""Writing values into the text of a plan: comments, order and layout stay as they are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from grammars.variation._plan import Gap, PlanText, Slot, Span


@dataclass(frozen=True, slots=True)
class Setting:
    """A number for a slot; without a ``unit`` it is in the unit of the slot."""

    slot: Slot
    number: float
    unit: str = ""


def rewrite(plan: PlanText, settings: Iterable[Setting], *, name: str = "") -> str:
    """Return the text of ``plan`` with all settings written into it, and perhaps a new name.

    A later setting of the same slot wins.
    """
    latest = {setting.slot.key: setting for setting in settings}
    replaced: list[tuple[Span, str]] = []
    for setting in latest.values():
        if setting.slot.gap is None:
            replaced.extend(_replacements(setting))
    if name:
        replaced.append((plan.name_at, name))
    return _apply(plan.text, replaced, _insertions(latest.values()))


def inserted_lines(plan: PlanText, slots: Iterable[Slot]) -> tuple[int, ...]:
    """Return after which lines of ``plan`` a new line appears when ``slots`` are set, in order."""
    settings = [Setting(slot, 0.0) for slot in slots]
    lines: list[int] = []
    for gap, text in _insertions(settings):
        lines += [plan.source.where(gap.offset).line] * text.count("\n")
    return tuple(sorted(lines))


def _insertions(settings: Iterable[Setting]) -> list[tuple[Gap, str]]:
    filled: dict[Gap, dict[str, str]] = {}
    for setting in settings:
        slot = setting.slot
        if slot.gap is not None:
            number = f"{slot.label}{_text(setting)} {setting.unit or slot.unit}"
            filled.setdefault(slot.gap, {})[slot.label] = number
    return [
        (gap, gap.header + gap.joiner.join(items[label] for label in sorted(items)))
        for gap, items in filled.items()
    ]


def _replacements(setting: Setting) -> list[tuple[Span, str]]:
    slot = setting.slot
    assert slot.number is not None
    if not isinstance(slot.value, float):
        return [(slot.number, f"{_text(setting)} {setting.unit or slot.unit}")]
    if not setting.unit:
        return [(slot.number, _text(setting))]
    if slot.unit_at is None:
        return [(slot.number, f"{_text(setting)} {setting.unit}")]
    return [(slot.number, _text(setting)), (slot.unit_at, setting.unit)]


def _text(setting: Setting) -> str:
    return repr(setting.number + 0.0)


def _apply(
    text: str, replaced: Sequence[tuple[Span, str]], inserted: Sequence[tuple[Gap, str]]
) -> str:
    edits = [(start, 0, end, new) for (start, end), new in replaced]
    edits.extend((gap.offset, gap.rank + 1, gap.offset, new) for gap, new in inserted)
    pieces: list[str] = []
    at = 0
    # A gap may open where a replaced number ends: what starts first is written first.
    for start, _, end, new in sorted(edits):
        pieces += (text[at:start], new)
        at = end
    return "".join((*pieces, text[at:]))
