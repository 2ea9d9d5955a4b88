"""The patterns are those that the detectors look for, upright, with their corners where the model says."""

import ctypes
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pyapriltags
import pytest

from tagsway.errors import InputError
from tagsway.tags.draw import cover_tag, draw_tag
from tagsway.tags.families import FAMILIES, tag_family, tag_pattern, used_cells

CELL_PX = 16


class _Image(ctypes.Structure):
    _fields_ = (
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
        ("stride", ctypes.c_int32),
        ("buf", ctypes.POINTER(ctypes.c_uint8)),
    )


@pytest.mark.parametrize("name", FAMILIES)
def test_the_pattern_is_the_library_s_own_drawing(name):
    path = Path(pyapriltags.__file__).with_name("libapriltag.so")
    if not path.exists():
        pytest.skip("the library has another name here")
    library = ctypes.CDLL(str(path))
    create, draw = library[f"{name}_create"], library["apriltag_to_image"]
    create.restype, draw.restype, draw.argtypes = (
        ctypes.c_void_p,
        ctypes.POINTER(_Image),
        [ctypes.c_void_p, ctypes.c_uint32],
    )
    family = tag_family(name)
    for tag_id in (0, 1, family.tag_count - 1):
        image = draw(create(), tag_id).contents
        grey = np.ctypeslib.as_array(image.buf, shape=(image.height, image.stride))[:, : image.width]
        used = used_cells(name)
        np.testing.assert_array_equal(tag_pattern(name, tag_id)[used], grey[used] > 127)


# The other families are large: their detectors take up to half a minute to make.
@pytest.mark.parametrize("name", ["tag36h11", "tag25h9", "tag16h5", "tagCircle21h7", "tagStandard41h12"])
def test_a_drawn_tag_is_found_upright_with_its_square_at_plus_minus_one(name):
    family = tag_family(name)
    detector = pyapriltags.Detector(families=name, quad_decimate=1.0)
    half, middle = CELL_PX * family.border_cells / 2, CELL_PX * (family.cells / 2 + 2)
    for tag_id in (0, 1, family.tag_count - 1):
        image = draw_tag(name, tag_id, cell_px=CELL_PX, quiet_cells=2)
        (found,) = detector.detect(np.pad(image // 2 + 60, 9, constant_values=187))
        assert (found.tag_id, found.hamming) == (tag_id, 0)
        tag_frame = (found.corners - 9 - middle) / half * (1, -1)
        # discretisation: the detector's own error on a perfect picture
        np.testing.assert_allclose(tag_frame, [(-1, -1), (1, -1), (1, 1), (-1, 1)], atol=0.01)


@pytest.mark.parametrize("name", ["tag36h11", "tagStandard41h12"])
def test_the_other_detector_finds_the_same_tag(name):
    pytest.importorskip("pupil_apriltags")
    code = (
        "import numpy as np, pupil_apriltags as p; from tagsway.tags.draw import draw_tag;"
        f"found, = p.Detector(families='{name}', nthreads=1).detect(draw_tag('{name}', 7, cell_px=20, quiet_cells=2));"
        "print(found.tag_id, *np.sign(found.corners - found.center).ravel().astype(int))"
    )
    # One detector to a process: two of different families find nothing at all.
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["7", "-1", "1", "1", "1", "1", "-1", "-1", "-1"]


def test_the_artwork_is_opencv_s_turned_by_half_a_turn():
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for tag_id in (0, 5, 586):
        theirs = cv2.aruco.generateImageMarker(dictionary, tag_id, 8, borderBits=1) > 0
        np.testing.assert_array_equal(tag_pattern("tag36h11", tag_id)[1:-1, 1:-1], theirs[::-1, ::-1])


def test_only_round_and_custom_tags_leave_cells_open():
    open_cells = {name: int(np.count_nonzero(~used_cells(name))) for name in FAMILIES}
    assert {name for name, count in open_cells.items() if count} == {
        "tagCircle21h7",
        "tagCircle49h12",
        "tagCustom48h12",
    }
    assert open_cells["tagCustom48h12"] == 4


def test_the_ink_of_a_covered_grid_is_the_ink_of_the_cells_on_any_grid():
    pattern, family = tag_pattern("tag36h11", 3), tag_family("tag36h11")
    x = np.sort(np.random.default_rng(1).uniform(-1.5, 1.5, 61))
    x[[0, -1]] = -1.5, 1.5
    white = cover_tag("tag36h11", 3, x, -x)
    ink = np.diff(x) @ (1 - white) @ np.diff(x)
    # identity
    assert ink == pytest.approx(np.count_nonzero(~pattern) * (2 / family.border_cells) ** 2, rel=1e-12)


def test_a_covered_grid_of_whole_cells_is_the_pattern():
    lines = (2 * np.arange(11) - 10) / 8
    np.testing.assert_allclose(cover_tag("tag36h11", 12, lines, -lines), tag_pattern("tag36h11", 12), atol=1e-12)


def test_an_unknown_family_names_those_that_are_known():
    with pytest.raises(InputError, match=r"no tag family 'tag36h12'.*tag36h11"):
        tag_family("tag36h12")


@pytest.mark.parametrize("tag_id", [-1, 587])
def test_an_id_outside_the_family_is_refused(tag_id):
    with pytest.raises(InputError, match="from 0 to 586"):
        tag_pattern("tag36h11", tag_id)


@pytest.mark.parametrize("options", [{"cell_px": 0}, {"quiet_cells": -1}])
def test_a_tag_cannot_be_drawn_without_pixels(options):
    with pytest.raises(InputError, match="needs cell_px"):
        draw_tag("tag36h11", 0, **options)
