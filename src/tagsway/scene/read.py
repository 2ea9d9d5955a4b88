"""A scene from its file."""

import csv
import json
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from tagsway.errors import InputError
from tagsway.files import read_toml
from tagsway.scene.model import Scene

WAYPOINT_COLUMNS = ("time_s", "x_m", "z_m")


def read_scene(path: Path) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : Path
        A TOML file with ``schema = "tagsway/scene/1"``; `tagsway.scene.model` names its keys. ``trajectory`` may be
        the name of a CSV file in the same folder, with the columns time_s, x_m and z_m.

    Returns
    -------
    Scene
        All that the file says, checked.

    Raises
    ------
    InputError
        Where the file cannot be read, has a key that is not known, or a value that cannot be.
    """
    path = Path(path)
    tree = read_toml(path, expected="a scene file")
    if "schema" not in tree:
        raise InputError(f'{path}: is no scene file: expected the line schema = "tagsway/scene/1"')
    if isinstance(tree.get("trajectory"), str):
        tree["trajectory"] = _read_waypoints(path.parent, tree["trajectory"])
    try:
        return TypeAdapter(Scene).validate_json(json.dumps(tree, default=str), strict=True)
    except ValidationError as error:
        raise InputError(f"{path}: {_explain(error)}") from None


def _explain(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] in ("unexpected_keyword_argument", "extra_forbidden"):
        return f"the key {place} is not known: leave it out, or look for a misprint"
    words = first["msg"].removeprefix("Value error, ")
    return f"{place}: {words}" if place else words


def _read_waypoints(folder: Path, name: str) -> dict[str, list[float]]:
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"the trajectory {name} lies outside the scene's folder: put it beside the scene file")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        return {column: [float(row[column]) for row in rows] for column in WAYPOINT_COLUMNS}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}): expected the scene's trajectory") from None
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path}: expected a CSV file with numbers in the columns time_s, x_m, z_m") from None
