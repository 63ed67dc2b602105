"""How commands print what they found."""

import json
from typing import Any, Protocol

from ..base.terminal import say


class Answer(Protocol):
    """What a command found: a text for people, and a dictionary for programs."""

    def as_dict(self) -> Any:
        """The answer as JSON's types."""


def show_json(value: Any) -> None:
    """Print a value as JSON on standard output."""
    say(json.dumps(value, indent=1))


def show(answer: Answer, as_json: bool, error: bool = False) -> None:
    """Print an answer: JSON on standard output, or a text, on standard error if it is an `error`."""
    if as_json:
        show_json(answer.as_dict())
    else:
        say(answer, error=error)
