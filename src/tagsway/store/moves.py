"""Reading move.toml."""

from pathlib import Path

from tagsway.errors import InputError
from tagsway.files import read_toml
from tagsway.model import Move
from tagsway.store.documents import validate

MOVE_SCHEMA = "tagsway/move/1"


def read_move(path: Path) -> Move:
    """Read a move file.

    Parameters
    ----------
    path : Path
        A TOML file with ``schema = "tagsway/move/1"`` and the fields of `Move`.

    Returns
    -------
    Move
        Checked; nothing is planned yet.

    Raises
    ------
    InputError
        Where the file cannot be read, is no TOML or of another schema, or where a key is missing, unknown or has a
        value that cannot be: names the file and the first such key.
    """
    document = read_toml(path, expected=f"a move file, {MOVE_SCHEMA}")
    if (schema := document.pop("schema", None)) != MOVE_SCHEMA:
        raise InputError(f"{path}: expected schema = {MOVE_SCHEMA!r}, found {schema!r}")
    return validate(Move, document, origin=str(path))
