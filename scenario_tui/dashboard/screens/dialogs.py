"""Dialogs over a screen: questions, menus, prompts, refusals, and the help.

The first three show the equivalent command, and return the answer as text, or ``None``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import ActiveBinding, Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.events import Key
from textual.screen import ModalScreen, Screen
from textual.validation import Validator
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.text.styles import BAD, GLYPHS, KNOWN, NEWS, QUIET

YES: Final = "yes"
_ANSWERS: Final = (
    f"[@click=screen.dismiss('{YES}')][b]y[/b] yes[/]   [@click=screen.dismiss][b]n[/b] no[/]"
)
_TYPED_ON: Final = frozenset(
    (*"0123456789jk", "minus", "backspace", "delete", "up", "down", "left", "right", "home", "end")
)
"""Keys after which the expected dialog would wait for another key."""
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


def same_as(command: str) -> Text:
    """Return the line with the equivalent command."""
    return Text(f"same as: {command}" if command else "", style=QUIET)


def move_cursor(options: OptionList, step: int) -> None:
    """Go to the next option, or for a negative ``step`` to the one before."""
    if step > 0:
        options.action_cursor_down()
    else:
        options.action_cursor_up()


class Question(ModalScreen[str]):
    """A yes-or-no question with the equivalent ``command``. Yes answers :data:`YES`."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", f"dismiss('{YES}')", "Yes", id="yes", tooltip="Do it"),
        Binding("n,escape,q", "dismiss", "No", id="no", tooltip="Leave it as it is"),
    ]

    def __init__(self, text: str, command: str) -> None:
        super().__init__()
        self._text, self._command = text, command

    def compose(self) -> ComposeResult:
        """Lay out the question with clickable answers."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._text), classes="title")
            yield Static(_ANSWERS)
            yield Static(same_as(self._command), id="same")


class Refusal(ModalScreen[None]):
    """The reason why a key does nothing, instead of the dialog that it would open.

    Keys typed for that dialog end here and do nothing on the screen below.
    """

    def __init__(self, why: str) -> None:
        super().__init__()
        self._why = why

    def compose(self) -> ComposeResult:
        """Lay out the reason."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._why))
            yield Static(Text.assemble(("enter closes this", QUIET)), classes="note")

    def on_key(self, event: Key) -> None:
        """Close, unless more keys for the expected dialog may come."""
        event.stop()
        if event.key not in _TYPED_ON:
            self.dismiss()

    def on_click(self) -> None:
        """Close."""
        self.dismiss()


@dataclass(frozen=True, slots=True)
class MenuChoice:
    """A line of a menu: its answer, its key, its text, the equivalent command."""

    answer: str
    key: str
    text: str
    command: str
    enabled: bool = True


class Menu(ModalScreen[str]):
    """A menu of choices; it returns the answer of the chosen one."""

    AUTO_FOCUS = "OptionList"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q", "dismiss", "Close", id="close", tooltip="Leave it as it is"),
        Binding("j", "move(1)", "Down", id="down", show=False, tooltip="The next choice"),
        Binding("k", "move(-1)", "Up", id="up", show=False, tooltip="The choice before"),
    ]

    def __init__(self, text: str, choices: Sequence[MenuChoice], note: str) -> None:
        super().__init__()
        self._text, self._choices, self._note = text, tuple(choices), note

    def compose(self) -> ComposeResult:
        """Lay out the choices, and the equivalent command below them."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._text), classes="title")
            options = (
                Option(Text.assemble((one.key, "bold"), f"  {one.text}"), disabled=not one.enabled)
                for one in self._choices
            )
            yield OptionList(*options, compact=True)
            yield StaticText(id="same")
            yield Static(Text(self._note), classes="note")

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        """Show the command of the choice under the cursor."""
        self.query_one("#same", Static).update(same_as(self._choices[event.option_index].command))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Return the choice."""
        self.dismiss(self._choices[event.option_index].answer)

    def on_key(self, event: Key) -> None:
        """Choose by the key of a line."""
        # Not by bindings, which belong to a class: the choices differ from menu to menu.
        for choice in self._choices:
            if choice.key == event.character and choice.enabled:
                event.stop()
                self.dismiss(choice.answer)
                return

    def action_move(self, step: int) -> None:
        """Move the cursor."""
        move_cursor(self.query_one(OptionList), step)


class Prompt(ModalScreen[str]):
    """Asks for a ``valid`` word; ``command`` returns the equivalent command."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss", "Close", id="close", tooltip="Leave it as it is"),
    ]

    def __init__(
        self, text: str, value: str, valid: Validator, command: Callable[[str], str]
    ) -> None:
        super().__init__()
        self._text, self._value, self._valid, self._command = text, value, valid, command

    def compose(self) -> ComposeResult:
        """Lay out the line to type into."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._text), classes="title")
            yield Input(self._value, validators=self._valid, compact=True, id="answer")
            yield StaticText(id="same")

    def on_input_changed(self, event: Input.Changed) -> None:
        """Show the error in the typed text, or the equivalent command."""
        why = event.validation_result.failure_descriptions if event.validation_result else []
        words = Text(why[0], style=BAD) if why else same_as(self._command(event.value))
        self.query_one("#same", Static).update(words)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Return the answer if it is valid."""
        if event.validation_result is None or event.validation_result.is_valid:
            self.dismiss(event.value.strip())


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
