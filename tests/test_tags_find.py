import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tag_images import make_pose, photograph, see_tag
from tagsway.errors import InputError
from tagsway.tags import find
from tagsway.tags.families import FAMILIES
from tagsway.tags.find import TagFinder, find_tags, find_tags_near
from tagsway.tags.others import find_other_tags, list_tags
from tagsway.tags.pose import CORNERS, project
from tagsway.video.writing import write_video

NEAR = 0.2  # px; the detector's own error is 0.03 to 0.1


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("angle", [0.0, 0.4, -3.0])
def test_corners_are_where_they_were_drawn_and_in_our_order(family: str, angle: float) -> None:
    pose = make_pose((100.3, 97.8), 64, angle, (0.04, -0.03))
    image = photograph(see_tag(pose, (200, 210), family=family, tag_id=5, background=190), 1, np.random.default_rng(0))
    (tag,) = find_tags(image, family=family)
    assert tag.tag_id == 5
    assert tag.hamming == 0
    assert np.abs(tag.corners_px - project(pose, CORNERS)).max() < NEAR


@pytest.mark.parametrize("side", [14, 20, 60, 200])
def test_small_and_large_tags_are_found(side: float) -> None:
    size = int(side * 2 + 20)
    pose = make_pose((size / 2, size / 2), side, 0.2)
    image = photograph(see_tag(pose, (size, size), tag_id=9), 2, np.random.default_rng(0))
    assert [tag.tag_id for tag in find_tags(image, family="tag36h11")] == [9]


@pytest.mark.parametrize("light", [(100, 140), (8, 30), (200, 225)])
def test_pale_and_dark_tags_are_found(light: tuple[int, int]) -> None:
    dark, white = light
    image = see_tag(make_pose((60, 60), 40, 0.2), (120, 120), tag_id=9, dark=dark, white=white, background=dark)
    assert [tag.tag_id for tag in find_tags(photograph(image, 1.5, np.random.default_rng(0)), family="tag36h11")] == [9]


@pytest.mark.parametrize("family", ["tag36h11", "tag25h9"])
def test_pale_clutter_is_no_tag(family: str) -> None:
    rng = np.random.default_rng(2)
    for cells in (3, 5, 8):
        clutter = 110 + 30 * np.kron(rng.random((400 // cells, 400 // cells)) < 0.5, np.ones((cells, cells)))
        assert find_tags(photograph(clutter, 1.5, rng), family=family) == ()


def test_tags_of_thirteen_pixels_are_found_in_an_enlarged_image_where_they_are() -> None:
    rng = np.random.default_rng(0)
    for angle in (0.1, 0.3, -0.4):
        pose = make_pose((60.3, 61.6), 13, angle)
        image = photograph(see_tag(pose, (120, 130), tag_id=9), 1, rng)
        (tag,) = find_tags(image, family="tag36h11", decimate=0.5)
        (near,) = find_tags_near(image, project(pose, CORNERS) + 4, family="tag36h11", decimate=0.5)
        assert tag.tag_id == near.tag_id == 9
        for found in (tag, near):
            assert np.abs(found.corners_px - project(pose, CORNERS)).max() < 2 * NEAR


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of the address space")
def test_the_largest_family_needs_no_gigabytes() -> None:
    # With two corrected bits its tables take 6 GB.
    script = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (2_000_000_000, 2_000_000_000));"
        "from tagsway.tags.find import TagFinder; TagFinder('tagStandard52h13')"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=300)


def test_a_wrong_bit_is_read_over_and_two_are_not() -> None:
    clean = see_tag(make_pose((60, 60), 64), (120, 120), tag_id=9)  # cells of 8 px
    for wrong, expected in ((1, [9]), (2, [])):
        image = photograph(clean, 1, np.random.default_rng(0))
        for k in range(wrong):
            cell = (slice(44, 52), slice(44 + 16 * k, 52 + 16 * k))
            image[cell] = 40 if image[cell].mean() > 120 else 200
        assert [tag.tag_id for tag in find_tags(image, family="tag36h11")] == expected


def test_a_part_of_the_image_gives_the_pixels_of_the_whole() -> None:
    pose = make_pose((300.4, 200.7), 50, 0.1)
    image = photograph(see_tag(pose, (400, 500), tag_id=3), 1, np.random.default_rng(0))
    corners = project(pose, CORNERS)
    (tag,) = find_tags_near(image, corners + 20, family="tag36h11")
    assert np.abs(tag.corners_px - corners).max() < NEAR


@pytest.mark.parametrize("place", [(-500.0, 10.0), (1e9, 1e9), (np.nan, 3.0), (499.0, 399.0), (-40.0, -40.0)])
def test_a_part_outside_the_image_holds_nothing(place: tuple[float, float]) -> None:
    image = np.full((400, 500), 128, np.uint8)
    assert find_tags_near(image, np.array([place, np.add(place, 30)]), family="tag36h11") == ()


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (15, 15), (0, 0), (16, 16)])
def test_tiny_images_do_no_harm(shape: tuple[int, int]) -> None:
    assert find_tags(np.zeros(shape, np.uint8), family="tag36h11") == ()


def test_clutter_is_no_tag() -> None:
    rng = np.random.default_rng(4)
    coarse = (rng.random((40, 50)) > 0.5).astype(np.uint8) * 200
    assert find_tags(np.kron(coarse, np.ones((12, 12), np.uint8)), family="tag36h11") == ()


def test_a_mirrored_tag_is_not_found() -> None:
    image = photograph(see_tag(make_pose((60, 60), 60), (120, 120), tag_id=1), 1, np.random.default_rng(0))
    assert find_tags(np.ascontiguousarray(image[:, ::-1]), family="tag36h11") == ()


def test_an_unknown_family_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"tag99.*tag36h11"):
        TagFinder("tag99")


def test_the_other_detector_stands_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pupil_apriltags", None)
    find.load_detector.cache_clear()
    try:
        finder = TagFinder("tag36h11")
    finally:
        find.load_detector.cache_clear()
    assert type(finder._detector).__module__.startswith("pyapriltags")
    pose = make_pose((80.25, 70.5), 60, 0.3)
    image = photograph(see_tag(pose, (150, 160), tag_id=2), 1, np.random.default_rng(0))
    for decimate in (1.0, 2.0):
        (tag,) = finder.find(image, decimate=decimate)
        assert tag.tag_id == 2
        assert np.abs(tag.corners_px - project(pose, CORNERS)).max() < NEAR


def test_detectors_come_and_go_without_harm() -> None:
    image = photograph(see_tag(make_pose((80, 70), 60), (140, 160)), 1, np.random.default_rng(0))
    for _ in range(3):
        for family in ("tag36h11", "tag25h9"):
            finder = TagFinder(family)
            finder.find(image)
            del finder


def test_other_tags_are_named_with_their_family() -> None:
    rng = np.random.default_rng(0)
    image = see_tag(make_pose((100, 100), 70, 0.1), (200, 420), family="tag25h9", tag_id=4)
    image = see_tag(make_pose((300, 100), 70, -0.1), (200, 420), tag_id=17, onto=image)
    greys = [photograph(image, 2, rng) for _ in range(3)]
    expected = {("tag25h9", 4), ("tag36h11", 17)}
    assert set(find_other_tags(greys)) == expected
    assert set(list_tags(greys)) == expected


def test_no_tags_and_no_images_name_nothing() -> None:
    assert find_other_tags([]) == ()
    assert find_other_tags([np.random.default_rng(0).integers(0, 255, (200, 300)).astype(np.uint8)] * 2) == ()


def test_a_search_that_takes_too_long_names_nothing() -> None:
    assert find_other_tags([np.zeros((200, 300), np.uint8)], timeout_s=0.01) == ()


@pytest.mark.slow
def test_a_process_that_decodes_and_detects_ends_well(tmp_path: Path) -> None:
    image = photograph(see_tag(make_pose((80, 70), 60), (140, 160)), 1, np.random.default_rng(0))
    video = tmp_path / "a.mp4"
    write_video(video, [image] * 12, fps_hz=30.0)
    # Eight processes that have loaded everything once: what could crash is how each of them ends.
    script = (
        "import os, sys\n"
        "from tagsway.tags.follow import follow_tags\n"
        "from tagsway.video.reading import read_clock, read_frames\n"
        "def work():\n"
        "    frames = read_frames(sys.argv[1], read_clock(sys.argv[1]), decoder_threads=2)\n"
        "    assert follow_tags(frames, family='tag36h11', tag_ids=[0, 1]).tags[0].seen.all()\n"
        "for _ in range(8):\n"
        "    child = os.fork() if hasattr(os, 'fork') else 0\n"
        "    if child == 0:\n"
        "        work()\n"
        "        sys.exit()\n"
        "    assert os.waitpid(child, 0)[1] == 0\n"
    )
    subprocess.run([sys.executable, "-c", script, str(video)], check=True, timeout=300)
