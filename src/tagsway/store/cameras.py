"""camera.json: a known lens."""

from pathlib import Path

from tagsway.files import write_text
from tagsway.model import Camera
from tagsway.store.documents import dump, read_json, to_document, validate

CAMERA_SCHEMA = "tagsway/camera/1"


def read_camera(path: Path) -> Camera:
    """Read camera.json.

    Raises
    ------
    InputError
        Where the file cannot be read or does not describe a camera.
    """
    return validate(Camera, read_json(path, CAMERA_SCHEMA), origin=str(path))


def write_camera(path: Path, camera: Camera) -> None:
    """Write camera.json, whole or not at all."""
    write_text(path, dump({"schema": CAMERA_SCHEMA, **to_document(camera)}))
