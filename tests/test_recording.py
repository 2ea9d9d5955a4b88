"""From a film on disk to sightings, with what is kept of it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tag_images import make_pose, see_tag
from tagsway.model import Settings
from tagsway.pipeline.recording import check_file, describe_tags, read_recording, track_video
from tagsway.store.steps import StepStore

FRAMES = [k for k in range(24) if k not in (9, 10, 17)]


def place(number: int) -> tuple[float, float]:
    return 60.0 + 4 * number, 50.0


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film") / "shot"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for number in FRAMES:
        image = np.full((180, 240), 120.0)
        right, down = place(number)
        for tag_id, lower in ((0, 0.0), (1, 80.0)):
            image = see_tag(make_pose((right, down + lower), 40.0), image.shape, tag_id=tag_id, onto=image)
        grey = np.clip(np.rint(image + rng.normal(scale=2, size=image.shape)), 0, 255).astype(np.uint8)
        assert cv2.imwrite(str(folder / f"{number:04d}.png"), grey)
    return folder


def test_numbered_images_are_tracked_at_their_own_times(images: Path) -> None:
    film = track_video(images / "%04d.png", Settings(fps_hz=50.0))
    sightings = film.sightings
    np.testing.assert_allclose(sightings.time_s, np.array(FRAMES) / 50, atol=1e-12)  # identity
    assert sightings.video.dropped == 3
    truth = np.array([place(number) for number in FRAMES])
    for tag in sightings.tags:
        assert (
            np.abs(tag.centre_px - truth - np.array([0, 80.0 * tag.tag_id])).max() < 0.1
        )  # statistics: many sigmas of the alignment


def test_what_was_tracked_is_kept_until_an_image_changes(images: Path, tmp_path: Path) -> None:
    settings = Settings(fps_hz=50.0)
    steps = StepStore(folder=tmp_path)
    check_file(images)
    first = read_recording(images, settings, steps=steps)
    steps.keep()
    calls: list[int] = []
    again = read_recording(
        images / "%04d.png", settings, steps=StepStore(folder=tmp_path), progress=lambda done, total: calls.append(done)
    )
    assert calls == []
    assert again.sha256 == first.sha256
    copy = tmp_path / "copy"
    copy.mkdir()
    for file in images.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    (copy / "0003.png").write_bytes((images / "0004.png").read_bytes())
    changed = read_recording(copy, settings, steps=StepStore(folder=tmp_path), progress=lambda *_: calls.append(1))
    assert calls
    assert changed.sha256 != first.sha256
    assert changed.video is not None
    assert changed.video.duplicated == 1  # 0003 and 0004 are one image now, of a tag that moves
    assert "repeated_images" in [notice.code for notice in changed.notices]


@pytest.mark.parametrize("spoil", [lambda image: image[:, ::-1], lambda image: 255 - image], ids=["mirror", "negative"])
def test_tags_that_no_detector_reads_are_told_from_none(tmp_path: Path, spoil) -> None:
    image = see_tag(make_pose((100, 100), 60, 0.2), (200, 220), tag_id=3).astype(np.uint8)
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), spoil(image))
    words = describe_tags(tmp_path)
    assert "tag36h11 3" in words
    assert "mirrored" in words
