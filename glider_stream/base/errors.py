"""Errors that are not bugs."""


class InputError(ValueError):
    """Unusable input; the message is one sentence that names the value received and the cure.

    Examples:
        >>> try:
        ...     glider_stream.read_scenario("seed-bx")
        ... except glider_stream.InputError as error:
        ...     print(error)  # doctest: +ELLIPSIS
        the scenario seed-bx ...
    """


class InputWarning(UserWarning):
    """Input that can be used but may not be what the user meant; the message is one sentence."""


class Unwritable(InputError):
    """An output that cannot be written whole, for example on a full disk."""


class Stopped(KeyboardInterrupt):
    """Work was interrupted from the keyboard; the message says what is kept, and how to continue."""
