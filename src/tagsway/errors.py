"""The few errors that tagsway raises on purpose.

Each message says what was wrong, its value, what was expected and what to do; `cli` prints it as one line and
turns its kind into an exit code.
"""


class TagswayError(Exception):
    """Anything that tagsway can explain."""


class InputError(TagswayError, ValueError):
    """The input or an option cannot be used (exit code 2)."""


class NotIdentifiableError(TagswayError):
    """The data are sound but do not determine what was asked (exit code 3).

    Parameters
    ----------
    message : str
        One line: what is missing, and what would help.
    code : str
        The warning code under which the result file records it.
    """

    def __init__(self, message: str, *, code: str = "not_determined") -> None:
        super().__init__(message)
        self.code = code
