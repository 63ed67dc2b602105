"""What can go wrong that is not a bug."""


class InputError(ValueError):
    """Unusable input; the message is one sentence that names the value received and the cure."""


class InputWarning(UserWarning):
    """Input that can be used, though it may not say what was meant; the message is one sentence."""


class Unwritable(InputError):
    """An output that cannot be written whole, as on a full disk."""


class Stopped(KeyboardInterrupt):
    """Work that was interrupted from the keyboard; the message says what is kept, and how to go on."""
