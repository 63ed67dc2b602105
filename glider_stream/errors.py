"""What can go wrong that is not a bug."""


class InputError(ValueError):
    """Unusable input; the message is one sentence that names the value received and the cure."""
