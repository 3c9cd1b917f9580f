"""Questions, menus and prompts over the screen they are about; each says what to type instead."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.console import RenderableType
from rich.style import Style
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.events import Key
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from scenario_tui.text.formatting import BAD, QUIET


def same_as(command: str) -> Text:
    """Return the words about what to type to do the same."""
    return Text(f"same as: {command}" if command else "", style=QUIET)


def move_cursor(options: OptionList, step: int) -> None:
    """Go to the next option, or with a negative ``step`` to the one before."""
    if step > 0:
        options.action_cursor_down()
    else:
        options.action_cursor_up()


class Question(ModalScreen[bool]):
    """A yes-or-no question; ``command`` is what to type to do the same."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "answer(True)", "Yes", id="yes", tooltip="Do it"),
        Binding("n,escape,q", "answer(False)", "No", id="no", tooltip="Leave it as it is"),
    ]

    def __init__(self, text: str, command: str) -> None:
        super().__init__()
        self._text, self._command = text, command

    def compose(self) -> ComposeResult:
        """Lay out the question; its answers can be clicked on."""
        text = Text(self._text + "\n\n")
        for key, word, answer in (("y", "yes", True), ("n", "no", False)):
            click = Style.from_meta({"@click": f"screen.answer({answer})"})
            text.append_text(Text.assemble((key, Style(bold=True) + click), (f" {word}", click)))
            text.append("   ")
        text.append("\n\n")
        text.append_text(same_as(self._command))
        with Vertical(classes="dialog"):
            yield Static(text)

    def action_answer(self, yes: bool) -> None:
        """Leave with the answer."""
        self.dismiss(yes)


@dataclass(frozen=True, slots=True)
class MenuChoice:
    """A line of a menu: its key if it has one, its meaning, the command that does the same.

    ``why_not`` says why it cannot be chosen.
    """

    key: str
    text: str
    command: str = ""
    why_not: str = ""


def numbered_choices(lines: Sequence[tuple[str, str]], first: int) -> list[MenuChoice]:
    """Return a choice for each text and its command; digits from ``first`` on are their keys."""
    return [
        MenuChoice(str(number) if number < 10 else "", text, command)
        for number, (text, command) in enumerate(lines, first)
    ]


class Menu(ModalScreen[int]):
    """A choice of several; leaves with the index of the one chosen."""

    AUTO_FOCUS = "OptionList"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q", "dismiss", "Close", id="close", tooltip="Leave it as it is"),
        Binding("j", "move(1)", "Down", id="down", show=False, tooltip="The next choice"),
        Binding("k", "move(-1)", "Up", id="up", show=False, tooltip="The choice before"),
    ]

    def __init__(self, text: str, choices: Sequence[MenuChoice], note: str = "") -> None:
        super().__init__()
        self._text, self._choices, self._note = text, tuple(choices), note

    def compose(self) -> ComposeResult:
        """Lay out the choices, and below them what to type instead."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._text), classes="title")
            yield OptionList(*(self._option(choice) for choice in self._choices), compact=True)
            yield Static(id="same")
            if self._note:
                yield Static(Text(self._note), classes="note")

    def _option(self, choice: MenuChoice) -> Option:
        text = Text.assemble((choice.key or " ", "bold"), f"  {choice.text}")
        if choice.why_not:
            text.append(f"  ({choice.why_not})", style=QUIET)
        return Option(text, disabled=bool(choice.why_not))

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        """Say what to type for the choice the cursor came to."""
        self.query_one("#same", Static).update(same_as(self._choices[event.option_index].command))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Leave with the choice."""
        self.dismiss(event.option_index)

    def on_key(self, event: Key) -> None:
        """Choose by the key of a line."""
        # Not bindings, which belong to a class: the choices differ from menu to menu.
        for index, choice in enumerate(self._choices):
            if choice.key and choice.key == event.character and not choice.why_not:
                event.stop()
                self.dismiss(index)
                return

    def action_move(self, step: int) -> None:
        """Move the cursor."""
        move_cursor(self.query_one(OptionList), step)


class Prompt(ModalScreen[str]):
    """Asks for a word; ``wrong`` says why one cannot be taken, ``command`` what to type instead."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss", "Close", id="close", tooltip="Leave it as it is"),
    ]

    def __init__(
        self, text: str, value: str, wrong: Callable[[str], str], command: Callable[[str], str]
    ) -> None:
        super().__init__()
        self._text, self._value = text, value
        self._wrong, self._command = wrong, command

    def compose(self) -> ComposeResult:
        """Lay out the line to type into."""
        with Vertical(classes="dialog"):
            yield Static(Text(self._text), classes="title")
            yield Input(self._value, compact=True, id="answer")
            yield Static(id="same")

    def on_input_changed(self, event: Input.Changed) -> None:
        """Say what is wrong with what is typed, or what to type elsewhere."""
        wrong = self._wrong(event.value.strip())
        words = Text(wrong, style=BAD) if wrong else same_as(self._command(event.value.strip()))
        self.query_one("#same", Static).update(words)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Leave with the answer, when it is one."""
        if not self._wrong(event.value.strip()):
            self.dismiss(event.value.strip())


class TextDialog(ModalScreen[None]):
    """Something longer to read."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,enter", "dismiss", "Close", id="close", tooltip="Back to the screen"),
        Binding("j", "scroll(1)", "Down", id="down", show=False, tooltip="A line further"),
        Binding("k", "scroll(-1)", "Up", id="up", show=False, tooltip="A line back"),
    ]

    def __init__(self, body: RenderableType, command: str = "") -> None:
        super().__init__()
        self._body, self._command = body, command

    def compose(self) -> ComposeResult:
        """Lay out what is told; it scrolls when it is long."""
        with VerticalScroll(classes="dialog"):
            yield Static(self._body)
            yield Static(same_as(self._command))

    def action_scroll(self, lines: int) -> None:
        """Scroll."""
        self.query_one(VerticalScroll).scroll_relative(y=lines, animate=False)
