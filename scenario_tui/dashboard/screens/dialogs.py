"""Dialogs over a screen: questions, menus, prompts, and refusals.

Each except the last shows the equivalent command. All return the answer as text, or ``None``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.events import Key
from textual.screen import ModalScreen
from textual.validation import Validator
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.text.styles import BAD, QUIET

YES: Final = "yes"
_ANSWERS: Final = (
    f"[@click=screen.dismiss('{YES}')][b]y[/b] yes[/]   [@click=screen.dismiss][b]n[/b] no[/]"
)
_TYPED_ON: Final = frozenset(
    (*"0123456789jk", "minus", "backspace", "delete", "up", "down", "left", "right", "home", "end")
)
"""Keys after which the expected dialog would wait for another key."""


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
