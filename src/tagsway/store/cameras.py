"""camera.json: a known lens."""

from pathlib import Path

from tagsway.model import Camera
from tagsway.store.documents import read_json, validate

CAMERA_SCHEMA = "tagsway/camera/1"


def read_camera(path: Path) -> Camera:
    """Read camera.json.

    Raises
    ------
    InputError
        Where the file cannot be read or does not describe a camera.
    """
    return validate(Camera, read_json(path, CAMERA_SCHEMA), origin=str(path))
