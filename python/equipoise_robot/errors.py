"""What the user did wrong."""


class UserError(ValueError):
    """Wrong input or set-up: one line for the user, naming the file or argument and the fix."""
