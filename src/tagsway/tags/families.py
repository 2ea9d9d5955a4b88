"""What the tags look like: the pattern of every tag of every family.

The codes come from the AprilTag library itself, so the pattern is the one that the detector looks for.
"""

import ctypes
import sys
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from tagsway.errors import InputError, TagswayError
from tagsway.model import BoolArray, IntArray

FAMILIES: tuple[str, ...] = (
    "tag36h11",
    "tag25h9",
    "tag16h5",
    "tagCircle21h7",
    "tagCircle49h12",
    "tagCustom48h12",
    "tagStandard41h12",
    "tagStandard52h13",
)
"""The families that can be found and drawn; the usual one first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagFamily:
    """A family of tags, all with the same layout.

    Parameters
    ----------
    name : str
        As in `FAMILIES`.
    cells : int
        Width of the whole pattern, in cells.
    border_cells : int
        Width of the square whose edge the detector follows, in cells: the tag's own frame has it at ±1, so a cell is
        ``2 / border_cells`` wide. A tag's size is the side of this square.
    reversed_border : bool
        False: that square is black on white, and the data lie inside it. True: it is the white square *within* the
        black ring, and data lie around the ring as well.
    tag_count : int
        Ids run from 0 to ``tag_count - 1``.
    """

    name: str
    cells: int
    border_cells: int
    reversed_border: bool
    tag_count: int


def tag_family(name: str) -> TagFamily:
    """Return the family of this name.

    Parameters
    ----------
    name : str
        One of `FAMILIES`.

    Returns
    -------
    TagFamily
        Its measures.

    Raises
    ------
    InputError
        Where there is no such family.
    """
    return _read_layout(name).family


def tag_pattern(family: str, tag_id: int) -> BoolArray:
    """Return the cells of one tag.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    tag_id : int
        Number in the family.

    Returns
    -------
    ndarray of bool, shape (cells, cells)
        True is white. Row 0 is the top of the upright official artwork. Cells that the family leaves open (see
        `used_cells`) are white, as paper is.

    Notes
    -----
    OpenCV's bitmaps of the same ids are turned by 180°.
    """
    layout = _read_layout(family)
    if not 0 <= tag_id < layout.family.tag_count:
        raise InputError(f"{family} has no tag {tag_id}: expected an id from 0 to {layout.family.tag_count - 1}")
    pattern = layout.empty.copy()
    bits = len(layout.columns)
    code = layout.codes[tag_id]
    pattern[layout.rows, layout.columns] = [bool(code >> (bits - 1 - i) & 1) for i in range(bits)]
    return pattern


def used_cells(family: str) -> BoolArray:
    """Return which cells of a family's pattern mean something.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.

    Returns
    -------
    ndarray of bool, shape (cells, cells)
        False where a print may show anything: the corners of a round tag, the hole of a custom one.
    """
    return _read_layout(family).used.copy()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Layout:
    family: TagFamily
    codes: tuple[int, ...]
    rows: IntArray
    columns: IntArray
    empty: BoolArray
    used: BoolArray


class _FamilyStruct(ctypes.Structure):
    """`apriltag_family_t` of the AprilTag 3 library."""

    _fields_ = (
        ("ncodes", ctypes.c_uint32),
        ("codes", ctypes.POINTER(ctypes.c_uint64)),
        ("width_at_border", ctypes.c_int),
        ("total_width", ctypes.c_int),
        ("reversed_border", ctypes.c_bool),
        ("nbits", ctypes.c_uint32),
        ("bit_x", ctypes.POINTER(ctypes.c_uint32)),
        ("bit_y", ctypes.POINTER(ctypes.c_uint32)),
    )


@cache
def _read_layout(name: str) -> _Layout:
    if name not in FAMILIES:
        raise InputError(f"there is no tag family {name!r}: expected one of {', '.join(FAMILIES)}")
    library = ctypes.CDLL(str(_library_path()))
    create, destroy = library[f"{name}_create"], library[f"{name}_destroy"]
    create.restype = ctypes.POINTER(_FamilyStruct)
    destroy.restype, destroy.argtypes = None, [ctypes.POINTER(_FamilyStruct)]
    pointer = create()
    try:
        found = pointer.contents
        family = TagFamily(
            name=name,
            cells=found.total_width,
            border_cells=found.width_at_border,
            reversed_border=found.reversed_border,
            tag_count=found.ncodes,
        )
        start = (family.cells - family.border_cells) // 2
        # Bits count from the border square; those around it are negative, in an unsigned field.
        columns = np.array(found.bit_x[: found.nbits], dtype=np.uint32).astype(np.int32).astype(np.int64) + start
        rows = np.array(found.bit_y[: found.nbits], dtype=np.uint32).astype(np.int32).astype(np.int64) + start
        codes = tuple(found.codes[: found.ncodes])
    finally:
        destroy(pointer)
    empty, used = _lay_out(family)
    used[rows, columns] = True
    return _Layout(family=family, codes=codes, rows=rows, columns=columns, empty=empty, used=used)


def _lay_out(family: TagFamily) -> tuple[BoolArray, BoolArray]:
    """Return the pattern without data, white where nothing is printed, and where its two rings are."""
    outer, inner = family.border_cells + 2, family.border_cells - 2
    rows, columns = np.indices((family.cells, family.cells))
    centre = family.cells - 1
    width = np.maximum(np.abs(2 * rows - centre), np.abs(2 * columns - centre)) + 1
    ring = (width > inner) & (width <= outer)
    dark = ring & ((width > family.border_cells) == family.reversed_border)
    return ~dark, ring


def _library_path() -> Path:
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    for name in ("pyapriltags", "pupil_apriltags"):
        package = find_spec(name)
        if package is not None and package.origin is not None:
            for path in sorted(Path(package.origin).parent.rglob("*apriltag*" + suffix)):
                return path
    raise TagswayError("the AprilTag library is missing: install the package pyapriltags again")
