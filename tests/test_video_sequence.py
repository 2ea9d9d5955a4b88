"""Numbered images, and the raw films of high-speed cameras."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.video.opening import list_files, name_film, name_results
from tagsway.video.reading import read_clock, read_frames

SHAPE = (24, 40)
LEVELS = [40, 80, 120, 160, 200]


def image_of(level: int, *, depth: int = 8) -> np.ndarray:
    """A flat image with a bright corner at the upper left, in so many bits."""
    image = np.full(SHAPE, level, np.uint8)
    image[:8, :8] = 250
    return image if depth == 8 else image.astype(np.uint16) << (depth - 8)


def put(folder: Path, numbers: list[int], *, name: str = "{:06d}.png", depth: int = 8) -> None:
    folder.mkdir(exist_ok=True)
    for number in numbers:
        assert cv2.imwrite(str(folder / name.format(number)), image_of(LEVELS[number % 5], depth=depth))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tiff", ".bmp"])
def test_numbered_images_are_a_film(tmp_path: Path, suffix: str) -> None:
    put(tmp_path / "shot", [7, 8, 9, 10, 11], name="{:06d}" + suffix)
    path = tmp_path / "shot" / f"%06d{suffix}"
    with read_frames(path, read_clock(path, fps_hz=200.0)) as reader:
        frames = list(reader)
    np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(5) / 200, atol=1e-12)
    for frame, number in zip(frames, range(7, 12), strict=True):
        assert np.median(frame.grey) == pytest.approx(LEVELS[number % 5], abs=2)  # discretisation: jpeg
    assert reader.info.time_source == "option"
    assert (reader.info.fps_hz, reader.info.dropped, reader.notices) == (200.0, 0, ())


@pytest.mark.parametrize("depth", [10, 12, 14, 16])
def test_images_of_more_bits_use_the_ones_that_the_camera_filled(tmp_path: Path, depth: int) -> None:
    put(tmp_path, [0, 1, 2, 3, 4], depth=depth)
    with read_frames(tmp_path / "%06d.png", read_clock(tmp_path / "%06d.png", fps_hz=100.0)) as reader:
        assert [int(frame.grey[-1, -1]) for frame in reader] == LEVELS


def test_a_missing_number_is_a_dropped_frame(tmp_path: Path) -> None:
    put(tmp_path, [0, 1, 2, 5, 6, 9])
    path = tmp_path / "%06d.png"
    with read_frames(path, read_clock(path, fps_hz=50.0)) as reader:
        assert [round(frame.time_s * 50) for frame in reader] == [0, 1, 2, 5, 6, 9]
    assert reader.info.dropped == 4


def test_an_image_that_cannot_be_read_is_left_out_and_said(tmp_path: Path) -> None:
    put(tmp_path, [0, 1, 2, 3])
    (tmp_path / "000002.png").write_bytes(b"no image")
    (tmp_path / "000003.png").write_bytes(b"")
    path = tmp_path / "%06d.png"
    with read_frames(path, read_clock(path, fps_hz=50.0)) as reader:
        assert [frame.index for frame in reader] == [0, 1]
    assert [notice.code for notice in reader.notices] == ["damaged_frames"]


def test_images_do_not_say_when_they_were_taken(tmp_path: Path) -> None:
    put(tmp_path, [0, 1, 2])
    with pytest.raises(InputError, match="give the capture rate with --fps"):
        read_clock(tmp_path / "%06d.png")
    with pytest.raises(InputError, match="--fps is -5"):
        read_clock(tmp_path / "%06d.png", fps_hz=-5.0)


@pytest.mark.parametrize("name", ["shot_{:04d}.png", "shot{}.png", "{:03d}.png"])
def test_a_folder_of_numbered_images_is_a_film(tmp_path: Path, name: str) -> None:
    put(tmp_path, [8, 9, 10, 11], name=name)
    (tmp_path / "notes.txt").write_text("beside them")
    assert [file.name for file in list_files(tmp_path)] == [name.format(number) for number in (8, 9, 10, 11)]
    assert len(read_clock(tmp_path, fps_hz=10.0).time_s) == 4


def test_a_folder_with_images_of_two_names_is_refused_with_a_way_out(tmp_path: Path) -> None:
    put(tmp_path, [0, 1, 2], name="left{:03d}.png")
    put(tmp_path, [0, 1], name="right{:03d}.png")
    with pytest.raises(InputError, match=r"left%03d\.png"):
        read_clock(tmp_path, fps_hz=10.0)
    assert len(read_clock(tmp_path / "right%03d.png", fps_hz=10.0).time_s) == 2


@pytest.mark.parametrize(
    ("pattern", "words"),
    [("%06d.tif", "no such images"), ("missing/%06d.png", "no folder"), ("%d-%d.png", "expected one number")],
)
def test_a_pattern_without_images_is_refused(tmp_path: Path, pattern: str, words: str) -> None:
    put(tmp_path, [0, 1, 2])
    with pytest.raises(InputError, match=words):
        read_clock(tmp_path / pattern, fps_hz=10.0)


def test_a_film_is_called_after_its_folder(tmp_path: Path) -> None:
    put(tmp_path / "shot7", [0, 1])
    pattern = tmp_path / "shot7" / "%06d.png"
    assert (name_film(pattern), name_results(pattern)) == ("shot7/%06d.png", "shot7")
    assert (name_film(pattern.parent), name_results(pattern.parent)) == ("shot7", "shot7")
    assert (name_film(Path("a/b.mp4")), name_results(Path("a/b.mp4"))) == ("b.mp4", "b")


CIHX = """junk before it <?xml version="1.0"?><cih>
<recordInfo><recordRate>{rate}</recordRate></recordInfo><frameInfo><totalFrame>{frames}</totalFrame></frameInfo>
<imageDataInfo><resolution><width>40</width><height>24</height></resolution><colorInfo><bit>{bits}</bit></colorInfo>
<effectiveBit><depth>{used}</depth><side>{side}</side></effectiveBit></imageDataInfo></cih>"""

CIH = """#Camera Information Header
Record Rate(fps) : {rate}
Total Frame : {frames}
Image Width : 40
Image Height : 24
Color Bit : {bits}
EffectiveBit Depth : {used}
EffectiveBit Side : {side}

"""


def pack(level: int, bits: int, side: str) -> bytes:
    if bits == 8:
        return image_of(level).tobytes()
    if bits == 16:
        return image_of(level, depth=12 if side == "Lower" else 16).astype("<u2").tobytes()
    # Twelve bits each, one after the other, the highest first.
    bitmap = "".join(f"{value:012b}" for value in image_of(level, depth=12).ravel())
    return int(bitmap, 2).to_bytes(len(bitmap) // 8, "big")


@pytest.mark.parametrize(("bits", "side"), [(8, "Lower"), (12, "Lower"), (16, "Lower"), (16, "Higher")])
@pytest.mark.parametrize(("suffix", "text"), [(".cihx", CIHX), (".cih", CIH)])
def test_a_photron_film_is_read_with_its_rate(tmp_path: Path, suffix: str, text: str, bits: int, side: str) -> None:
    used = 8 if bits == 8 else 12
    header = tmp_path / f"shot{suffix}"
    header.write_text(text.format(rate=2000, frames=5, bits=bits, used=used, side=side))
    (tmp_path / "shot.mraw").write_bytes(b"".join(pack(level, bits, side) for level in LEVELS))
    for path in (header, tmp_path / "shot.mraw"):
        with read_frames(path, read_clock(path)) as reader:
            frames = list(reader)
        for frame, level in zip(frames, LEVELS, strict=True):
            np.testing.assert_array_equal(frame.grey, image_of(level))
        assert reader.info.fps_hz == 2000
        assert frames[-1].time_s == pytest.approx(4 / 2000)
    assert len(list_files(header)) == 2


def test_a_photron_film_that_was_cut_off_is_used_as_far_as_it_goes(tmp_path: Path) -> None:
    (tmp_path / "shot.cihx").write_text(CIHX.format(rate=500, frames=9, bits=8, used=8, side="Lower"))
    (tmp_path / "shot.mraw").write_bytes(b"".join(pack(level, 8, "Lower") for level in LEVELS) + bytes(100))
    with read_frames(tmp_path / "shot.mraw", read_clock(tmp_path / "shot.mraw")) as reader:
        assert len(list(reader)) == 5
    assert [notice.code for notice in reader.notices] == ["truncated"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nothing", "does not say width"),
        (CIHX.format(rate=0, frames=5, bits=8, used=8, side="Lower"), "at 0 Hz"),
        (CIHX.format(rate=500, frames=5, bits=24, used=8, side="Lower"), "24 bits"),
        (CIHX.format(rate="fast", frames=5, bits=8, used=8, side="Lower"), "fast"),
        (CIHX.format(rate=5, frames=5, bits=8, used=8, side="Lower").replace("</colorInfo>", ""), "description"),
    ],
)
def test_a_photron_description_that_says_nothing_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "shot.cihx").write_text(text)
    (tmp_path / "shot.mraw").write_bytes(bytes(5000))
    with pytest.raises(InputError, match=words) as caught:
        read_clock(tmp_path / "shot.mraw")
    assert "\n" not in str(caught.value)


def test_a_photron_film_needs_both_files(tmp_path: Path) -> None:
    (tmp_path / "shot.mraw").write_bytes(bytes(5000))
    with pytest.raises(InputError, match=r"no shot\.cihx or \.cih beside it"):
        read_clock(tmp_path / "shot.mraw")


def write_cine(path: Path, *, rate_hz: int, depth: int) -> None:
    """Write a Phantom film of five grey images, bottom row first, by the published layout of its headers."""
    height, width = SHAPE
    bits = 8 if depth == 8 else 16
    setup = bytearray(0x2400)
    setup[140:144] = struct.pack("<2sH", b"ST", len(setup))
    setup[768:772] = struct.pack("<I", rate_hz)
    setup[896:900] = struct.pack("<I", depth)
    head, at_setup = 44, 44 + 40
    at_index = at_setup + len(setup)
    images = [image_of(level, depth=depth)[::-1].tobytes() for level in LEVELS]
    first = at_index + 8 * len(images)
    places = [first + k * (8 + len(images[0])) for k in range(len(images))]
    content = struct.pack("<2sHHHiIiIIII", b"CI", head, 0, 1, 0, 5, 0, 5, head, at_setup, at_index) + bytes(8)
    content += struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, 0, len(images[0]), 0, 0, 0, 0)
    content += bytes(setup) + struct.pack("<5Q", *places)
    for image in images:
        content += struct.pack("<II", 8, len(image)) + image
    path.write_bytes(content)


@pytest.mark.parametrize("depth", [8, 10, 12, 14, 16])
def test_a_phantom_film_is_read_with_the_rate_of_its_capture(tmp_path: Path, depth: int) -> None:
    path = tmp_path / "shot.cine"
    write_cine(path, rate_hz=1000, depth=depth)
    with read_frames(path, read_clock(path)) as reader:
        frames = list(reader)
    for frame, level in zip(frames, LEVELS, strict=True):
        np.testing.assert_allclose(frame.grey.astype(float), image_of(level), atol=1)  # discretisation: a grey level
    assert reader.info.fps_hz == pytest.approx(1000)
    assert frames[-1].time_s == pytest.approx(4e-3)
