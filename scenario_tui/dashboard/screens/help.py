"""Help: the keys of the screen below, and the signs."""

from __future__ import annotations

from typing import ClassVar, Final

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import ActiveBinding, Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen, Screen
from textual.widgets import Static

from scenario_tui.text.styles import GLYPHS, KNOWN, NEWS, QUIET

_SIGNS: Final = (
    *((glyph, word, word) for word, glyph in GLYPHS.items()),
    ("!", NEWS, "not as expected"),
    ("a", KNOWN, "known failure, with its reason: a known: slips"),
    ("▂▅█", "pass", "passes: the lower, the nearer to failing"),
    ("▂", KNOWN, "close pass"),
    ("✗", "fail.far", "failure far beyond the limit"),
)
"""Signs of tables and of the matrix, their styles and meanings."""
_HERE: Final = "here"


class Help(ModalScreen[None]):
    """The enabled keys, as the user has them; below them the signs."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,question_mark,f1,q", "dismiss", "Close", id="close", tooltip="Back"),
        Binding("j", "scroll(1)", "Down", id="down", show=False, tooltip="A line further"),
        Binding("k", "scroll(-1)", "Up", id="up", show=False, tooltip="A line back"),
    ]

    def __init__(self, about: Screen[object]) -> None:
        super().__init__()
        self._active = our_bindings(about)

    def compose(self) -> ComposeResult:
        """Lay out keys and signs."""
        dialog = VerticalScroll(classes="dialog")
        dialog.border_title = "Keys and signs"
        with dialog:
            yield Static(self._table())

    def _table(self) -> Table:
        # Imported here, because the modules of maps load slowly.
        from scenario_tui.dashboard.widgets.map_style import SIGNS, STYLES

        table = Table.grid(padding=(0, 2))
        table.add_column(justify="right", no_wrap=True)
        # By place and by action, which may have several keys.
        groups: dict[str, dict[str, list[ActiveBinding]]] = {_HERE: {}}
        for active in self._active:
            group = groups.setdefault(active.node.BINDING_GROUP_TITLE or _HERE, {})
            group.setdefault(active.binding.action, []).append(active)
        for title, rows in groups.items():
            table.add_row("", Text(title, style=QUIET))
            for actives in rows.values():
                names = dict.fromkeys(self.app.get_key_display(one.binding) for one in actives)
                name, about = actives[0].binding.description, f": {actives[0].binding.tooltip}"
                table.add_row(
                    Text(" ".join(names), style="bold"), Text.assemble(name, (about, QUIET))
                )
        map_signs = [(sign, STYLES[layer], words) for layer, sign, words in SIGNS]
        for title, signs in (("signs", _SIGNS), ("on the map", map_signs)):
            table.add_row("", Text(title, style=QUIET))
            for sign, style, words in signs:
                table.add_row(Text(sign, style=style), words)
        table.add_row("", Text("choose other keys: scenario tui --bindings", style=QUIET))
        return table

    def action_scroll(self, lines: int) -> None:
        """Scroll."""
        self.query_one(VerticalScroll).scroll_relative(y=lines, animate=False)


def our_bindings(screen: Screen[object]) -> list[ActiveBinding]:
    """Return our enabled bindings, without those of Textual."""
    active = screen.active_bindings.values()
    return [one for one in active if one.enabled and one.binding.id is not None]
