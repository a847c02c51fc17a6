"""The error that commands show as one line."""


class UserError(Exception):
    """Something the user can mend: the text says what came, what was expected and what to do."""
