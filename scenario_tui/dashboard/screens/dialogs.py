"""Dialogs over the screen they are about: questions, menus, prompts, and refusals.

Each but the last says what to type instead. All leave with the answer as text, or with ``None``.
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
"""Keys after which the dialog that was expected would wait for another one."""


def same_as(command: str) -> Text:
    """Return the words about what to type to do the same."""
    return Text(f"same as: {command}" if command else "", style=QUIET)


def move_cursor(options: OptionList, step: int) -> None:
    """Go to the next option, or with a negative ``step`` to the one before."""
    if step > 0:
        options.action_cursor_down()
    else:
        options.action_cursor_up()


class Question(ModalScreen[str]):
    """A yes-or-no question; ``command`` is what to type to do the same. The answer is `YES`."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", f"dismiss('{YES}')", "Yes", id="yes", tooltip="Do it"),
        Binding("n,escape,q", "dismiss", "No", id="no", tooltip="Leave it as it is"),
    ]

    def __init__(self, text: str, command: str) -> None:
        super().__init__()
        self._text, self._command = text, command

    def compose(self) -> ComposeResult:
        """Lay out the question; its answers can be clicked on."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._text), classes="title")
            yield Static(_ANSWERS)
            yield Static(same_as(self._command), id="same")


class Refusal(ModalScreen[None]):
    """The reason why a key does nothing, in the place of the dialog that it would have opened.

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
        """Close, unless more is to be expected."""
        event.stop()
        if event.key not in _TYPED_ON:
            self.dismiss()

    def on_click(self) -> None:
        """Close."""
        self.dismiss()


@dataclass(frozen=True, slots=True)
class MenuChoice:
    """A line of a menu: its answer, its key, its meaning, the command that does the same."""

    answer: str
    key: str
    text: str
    command: str
    enabled: bool = True


class Menu(ModalScreen[str]):
    """A choice of several; leaves with the answer of the one chosen."""

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
        """Lay out the choices, and below them what to type instead."""
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
        """Say what to type for the choice the cursor came to."""
        self.query_one("#same", Static).update(same_as(self._choices[event.option_index].command))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Leave with the choice."""
        self.dismiss(self._choices[event.option_index].answer)

    def on_key(self, event: Key) -> None:
        """Choose by the key of a line."""
        # Not bindings, which belong to a class: the choices differ from menu to menu.
        for choice in self._choices:
            if choice.key == event.character and choice.enabled:
                event.stop()
                self.dismiss(choice.answer)
                return

    def action_move(self, step: int) -> None:
        """Move the cursor."""
        move_cursor(self.query_one(OptionList), step)


class Prompt(ModalScreen[str]):
    """Asks for a word that is ``valid``; ``command`` returns what to type instead."""

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
        """Say what is wrong with what is typed, or what to type elsewhere."""
        why = event.validation_result.failure_descriptions if event.validation_result else []
        words = Text(why[0], style=BAD) if why else same_as(self._command(event.value))
        self.query_one("#same", Static).update(words)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Leave with the answer, when it is one."""
        if event.validation_result is None or event.validation_result.is_valid:
            self.dismiss(event.value.strip())
