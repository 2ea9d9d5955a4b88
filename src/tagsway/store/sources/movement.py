"""movement's netCDF files: points over time, classic or HDF5."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import netcdf_file

from tagsway.errors import InputError
from tagsway.model import FloatArray
from tagsway.store.sources.build import TrackSource
from tagsway.store.sources.poses import LEAST_LIKELIHOOD, pick_points

CLASSIC, HDF5 = b"CDF", b"\x89HDF"
"""How the two kinds of netCDF files begin."""

LAYOUT = ("time", "space", "keypoints", "individuals")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Table:
    """What is used of a file: numbers in the order of `LAYOUT`, names, times in s or None, and the frame rate."""

    position: FloatArray
    confidence: FloatArray | None
    keypoints: tuple[str, ...]
    individuals: tuple[str, ...]
    time_s: FloatArray | None


def is_movement(path: Path) -> bool:
    """Say whether a file is a netCDF file, of either kind."""
    try:
        with path.open("rb") as file:
            start = file.read(len(HDF5))
    except OSError:
        return False
    return start.startswith(CLASSIC) or start == HDF5


def read_movement(path: Path, *, fps_hz: float | None) -> TrackSource:
    """Return the track of the points that are called TCP and PCP (tool, product), or of the only point.

    Parameters
    ----------
    path : Path
        A pose data set of movement: `position` over time, space, keypoints and individuals.
    fps_hz : float or None
        Capture rate, where the file's own is not to be taken or it has none.

    Returns
    -------
    TrackSource
        In pixels, z upwards.

    Raises
    ------
    InputError
        Where it is no such data set, has no times, or needs h5py, which is not installed; and where it is not clear
        which point is the product.

    Notes
    -----
    Classic netCDF is read by SciPy. xarray writes HDF5 where it finds netCDF4 or h5netcdf: that takes h5py.
    """
    with path.open("rb") as file:
        classic = file.read(len(CLASSIC)) == CLASSIC
    try:
        table = _read_classic(path) if classic else _read_hdf5(path)
    except InputError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, OSError) as fault:
        raise InputError(
            f"{path} is a netCDF or HDF5 file and no pose data set of movement ({fault}): export it as CSV"
        ) from None
    time = table.time_s
    if fps_hz is not None:
        time = np.arange(len(table.position)) / fps_hz
    if time is None:
        raise InputError(f"{path} counts frames and has no times: say --fps, the capture rate")
    points = {}
    for k, owner in enumerate(table.individuals):
        for i, part in enumerate(table.keypoints):
            point = table.position[:, :2, i, k] * [1.0, -1.0]
            if table.confidence is not None:
                sure = table.confidence[:, i, k]
                point[~((sure >= LEAST_LIKELIHOOD) | np.isnan(sure))] = np.nan
            points[f"{owner} {part}" if len(table.individuals) > 1 else part] = point
    return pick_points(points, np.arange(len(time)), time, path=path, program="movement")


def _ordered(value: FloatArray, dimensions: tuple[str, ...], wanted: tuple[str, ...]) -> FloatArray:
    """Return an array with its axes in this order."""
    return np.asarray(np.transpose(value, [dimensions.index(name) for name in wanted]), dtype=float)


def _make(
    array: Callable[[str], tuple[FloatArray, tuple[str, ...]]],
    names: Callable[[str], tuple[str, ...]],
    attributes: dict[str, Any],
    *,
    has_confidence: bool,
) -> _Table:
    confidence = _ordered(*array("confidence"), (LAYOUT[0], *LAYOUT[2:])) if has_confidence else None
    # netCDF's attributes are arrays, of one number too.
    rate = np.ravel(attributes.get("fps", np.nan))[0]
    time, fps = array("time")[0].astype(float), float(rate) if rate else np.nan
    unit = attributes.get("time_unit", "seconds" if fps > 0 else "frames")
    unit = unit.decode() if isinstance(unit, bytes) else str(unit)
    seconds = time if unit == "seconds" else time / fps
    return _Table(
        position=_ordered(*array("position"), LAYOUT),
        confidence=confidence,
        keypoints=names("keypoints"),
        individuals=names("individuals"),
        time_s=seconds if np.isfinite(seconds).all() else None,
    )


def _read_classic(path: Path) -> _Table:
    with netcdf_file(path, "r", mmap=False) as file:

        def array(name: str) -> tuple[FloatArray, tuple[str, ...]]:
            variable = file.variables[name]
            return np.array(variable.data), tuple(variable.dimensions)

        def names(name: str) -> tuple[str, ...]:
            letters = np.array(file.variables[name].data)
            return tuple(b"".join(row).rstrip(b"\x00 ").decode() for row in letters.reshape(len(letters), -1))

        attributes = {name: getattr(file, name) for name in ("fps", "time_unit") if hasattr(file, name)}
        return _make(array, names, attributes, has_confidence="confidence" in file.variables)


def _read_hdf5(path: Path) -> _Table:
    try:
        h5py: Any = import_module("h5py")
    except ModuleNotFoundError:
        raise InputError(
            f"{path} is an HDF5 file, such as movement's netCDF: `pip install h5py` lets it be read, or save it as CSV"
        ) from None
    with h5py.File(path, "r") as file:

        def array(name: str) -> tuple[FloatArray, tuple[str, ...]]:
            data = file[name]
            scales = [axis[0].name.lstrip("/") for axis in data.dims] if data.dims[0] else [name]
            return np.array(data), tuple(scales)

        def names(name: str) -> tuple[str, ...]:
            return tuple(one.decode() if isinstance(one, bytes) else str(one) for one in np.array(file[name]))

        return _make(array, names, dict(file.attrs), has_confidence="confidence" in file)
