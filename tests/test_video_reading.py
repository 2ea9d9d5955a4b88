import threading
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.video.container import _take_field
from tagsway.video.reading import read_clock, read_frames

SHAPE = (66, 100)  # no multiple of 16: the decoder's lines are longer than the image's
CODED = 3.0  # grey levels that a lossy codec may be off on a flat image


def flat(level: int) -> np.ndarray:
    """A grey image with a white upper left corner."""
    image = np.full(SHAPE, level, np.uint8)
    image[:24, :32] = 250
    return image


def write(path: Path, images: list[np.ndarray], **how: Any) -> Path:
    """Write grey images; pixel values are those of a full-range image."""
    codec, form, options = how.get("codec", "libx264"), how.get("form", "yuv420p"), how.get("options", {})
    stamps, tick = how.get("stamps"), how.get("tick", Fraction(1, 30))
    with av.open(str(path), "w", options=how.get("container", {})) as container:
        stream = container.add_stream(codec, rate=how.get("rate", 30), options=options)
        stream.width, stream.height, stream.pix_fmt = images[0].shape[1], images[0].shape[0], form
        stream.codec_context.time_base = tick
        for key, value in how.get("metadata", {}).items():
            container.metadata[key] = value
        if how.get("rotation"):
            stream.set_display_rotation(how["rotation"])
        for k, image in enumerate(images):
            picture = av.VideoFrame.from_ndarray(cv2.cvtColor(image, cv2.COLOR_GRAY2RGB), format="rgb24")
            frame = picture.reformat(format=form, dst_color_range=how.get("range", "MPEG"))
            frame.pts, frame.time_base = k if stamps is None else stamps[k], tick
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def read(path: Path, **options: Any) -> tuple[list[Any], Any]:
    reader = read_frames(path, read_clock(path), **options)
    return list(reader), reader


LEVELS = [40, 80, 120, 160, 200]


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("a.mp4", {}),
        ("a.mp4", {"range": "JPEG", "form": "yuvj420p"}),
        ("a.mkv", {"codec": "ffv1", "form": "gray"}),
        ("a.mkv", {"codec": "ffv1", "form": "gray10le"}),
        ("a.mkv", {"codec": "ffv1", "form": "yuv422p10le"}),
        ("a.mkv", {"codec": "ffv1", "form": "bgr0"}),
        ("a.mp4", {"codec": "libx265", "form": "yuv420p10le", "options": {"x265-params": "log-level=none"}}),
        ("a.avi", {"codec": "mjpeg", "form": "yuvj420p"}),
        ("a.avi", {"codec": "mpeg4"}),
        ("a.avi", {"codec": "rawvideo", "form": "yuv420p"}),
        ("a.avi", {"codec": "rawvideo", "form": "bgr24"}),
        ("a.avi", {"codec": "rawvideo", "form": "gray"}),
        ("a.mkv", {"codec": "rawvideo", "form": "gray"}),
        ("a.mkv", {"codec": "ffv1", "form": "gray12le"}),
        ("a.mkv", {"codec": "ffv1", "form": "gray16le"}),
    ],
)
def test_grey_values_come_in_full_range_whatever_the_format(tmp_path: Path, name: str, how: dict[str, Any]) -> None:
    frames, reader = read(write(tmp_path / name, [flat(level) for level in LEVELS], **how))
    assert [frame.index for frame in frames] == list(range(len(LEVELS)))
    for frame, level in zip(frames, LEVELS, strict=True):
        assert frame.grey.shape == SHAPE
        assert frame.grey.dtype == np.uint8
        assert np.median(frame.grey[30:, 40:]) == pytest.approx(level, abs=CODED)
        assert np.median(frame.grey[:20, :28]) == pytest.approx(250, abs=CODED)
    assert reader.info.frames == len(LEVELS)
    assert (reader.info.width, reader.info.height) == SHAPE[::-1]
    assert reader.notices == ()


def test_limited_range_may_be_left_as_it_is_coded(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", [flat(0), flat(255)])
    frames, _ = read(path, full_range=False)
    assert np.median(frames[0].grey[30:, 40:]) == pytest.approx(16, abs=CODED)
    assert np.median(frames[1].grey[30:, 40:]) == pytest.approx(235, abs=CODED)


@pytest.mark.parametrize("name", ["a.mp4", "a.mkv", "a.avi", "a.mov"])
@pytest.mark.parametrize("threads", [1, 2])
def test_frames_that_are_coded_out_of_order_come_in_order(tmp_path: Path, name: str, threads: int) -> None:
    levels = [30 + 3 * k for k in range(60)]
    codec = {"codec": "mpeg4", "options": {"bf": "2"}} if name == "a.avi" else {"options": {"bf": "3"}}
    path = write(tmp_path / name, [flat(level) for level in levels], **codec)
    frames, reader = read(path, decoder_threads=threads)
    assert len(frames) == len(levels)
    seen = np.array([np.median(frame.grey[30:, 40:]) for frame in frames])
    np.testing.assert_allclose(seen, levels, atol=CODED)
    np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(60) / 30, atol=1e-9)
    assert reader.info.fps_hz == pytest.approx(30)
    assert reader.info.duration_s == pytest.approx(2.0)


def test_dropped_frames_keep_their_times(tmp_path: Path) -> None:
    kept = [0, 1, 2, 5, 6, 9, 10, 11]
    path = write(tmp_path / "a.mkv", [flat(20 * k) for k in kept], stamps=kept)
    frames, reader = read(path)
    np.testing.assert_allclose([frame.time_s * 30 for frame in frames], kept, atol=1e-2)  # 1 ms stamps
    assert reader.info.dropped == 4


def test_the_option_scales_the_times_of_the_frames(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", [flat(99)] * 10)
    with read_frames(path, read_clock(path, fps_hz=300.0)) as reader:
        assert [frame.time_s for frame in reader] == pytest.approx(list(np.arange(10) / 300))
    assert reader.info.time_source == "option"
    assert reader.info.fps_hz == pytest.approx(300)


def test_a_capture_rate_in_the_metadata_is_used(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.mp4",
        [flat(99)] * 10,
        metadata={"com.android.capture.fps": "240.0"},
        container={"movflags": "use_metadata_tags"},
    )
    clock = read_clock(path)
    assert clock.time_source == "metadata"
    assert clock.fps_hz == pytest.approx(240)


@pytest.mark.parametrize(
    ("rotation", "turn"),
    [(-90, cv2.ROTATE_90_CLOCKWISE), (90, cv2.ROTATE_90_COUNTERCLOCKWISE), (180, cv2.ROTATE_180)],
)
def test_a_phone_held_upright_gives_upright_images(tmp_path: Path, rotation: int, turn: int) -> None:
    path = write(tmp_path / "a.mp4", [flat(100)] * 3, rotation=rotation)
    frames, reader = read(path)
    shown = cv2.rotate(flat(100), turn)
    assert frames[0].grey.shape == shown.shape
    assert np.abs(frames[0].grey.astype(float) - shown).mean() < CODED
    assert (reader.info.height, reader.info.width) == shown.shape


@pytest.mark.parametrize("name", ["a.mkv", "a.mp4", "a.avi"])
def test_of_a_video_that_was_cut_off_what_there_is_is_used(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, SHAPE).astype(np.uint8) for _ in range(60)]
    whole = write(
        tmp_path / name, images, codec="mpeg4", container={"movflags": "faststart"} if name == "a.mp4" else {}
    )
    cut = tmp_path / f"cut-{name}"
    cut.write_bytes(whole.read_bytes()[: int(0.55 * whole.stat().st_size)])
    frames, reader = read(cut)
    assert 20 <= len(frames) <= 40
    assert "truncated" in [notice.code for notice in reader.notices]


@pytest.mark.parametrize("name", ["a.mkv", "a.mp4", "a.ts"])
def test_a_whole_video_whose_stamps_begin_late_is_not_called_cut_off(tmp_path: Path, name: str) -> None:
    late = [150 + k for k in range(30)]
    frames, reader = read(write(tmp_path / name, [flat(99)] * 30, stamps=late))
    assert len(frames) == 30
    assert reader.notices == ()


def test_a_bare_stream_of_a_coder_has_no_times(tmp_path: Path) -> None:
    path = write(tmp_path / "a.h264", [flat(level) for level in LEVELS], rate=100, tick=Fraction(1, 100))
    with pytest.raises(InputError, match="--fps"):
        read_clock(path)
    clock = read_clock(path, fps_hz=100)
    frames = list(read_frames(path, clock))
    assert [frame.time_s for frame in frames] == pytest.approx([0, 0.01, 0.02, 0.03, 0.04])
    assert [abs(frame.grey[-1, -1] - level) < CODED + 1 for frame, level in zip(frames, LEVELS, strict=True)] == [
        True
    ] * 5


def test_frames_that_cannot_be_decoded_are_left_out_and_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mkv", [flat(5 * k) for k in range(40)], codec="ffv1", form="gray")
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(40)
    path.write_bytes(content)
    frames, reader = read(path)
    assert len(frames) >= 30
    for frame in frames:
        assert frame.time_s == pytest.approx(frame.index / 30, abs=1e-3)
    assert len(frames) == 40 or reader.notices


def test_leaving_early_leaves_no_thread(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", [flat(99)] * 80)
    before = threading.active_count()
    with read_frames(path, read_clock(path), queue_frames=2) as reader:
        first = next(reader)
        assert threading.active_count() == before + 1
    assert threading.active_count() == before
    assert list(reader) == []
    assert first.grey[40, 60] == pytest.approx(99, abs=CODED)


def test_the_decoder_waits_for_whoever_reads(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", [flat(99)] * 80)
    with read_frames(path, read_clock(path), queue_frames=3) as reader:
        next(reader)
        for _ in range(200):
            time.sleep(0.001)
            assert reader._decoded._queues[0].qsize() <= 3
        assert reader._decoded._own[0].empty()
        assert reader._decoded._threads[0].is_alive()
        assert sum(1 for _ in reader) == 79


def test_a_reader_that_was_never_started_closes(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", [flat(99)] * 3)
    read_frames(path, read_clock(path)).close()


def test_what_is_no_video_is_refused_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "empty.mp4").touch()
    (tmp_path / "bare").mkdir()
    (tmp_path / "text.mp4").write_text("this is no video\n" * 100)
    for path, words in [
        (tmp_path / "missing.mp4", "does not exist"),
        (tmp_path / "bare", "is a folder without images"),
        (tmp_path / "empty.mp4", "is empty"),
        (tmp_path / "text.mp4", "no video that can be read"),
    ]:
        with pytest.raises(InputError, match=words) as caught:
            read_clock(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_an_mp4_without_its_index_is_refused(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.mp4", [flat(k) for k in range(60)])
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(InputError, match="no index"):
        read_clock(cut)


def test_one_frame_is_no_video(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds 1 frame: expected a video of at least two"):
        read_clock(write(tmp_path / "a.mp4", [flat(9)]))


def test_sound_alone_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000, layout="mono")
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
        container.mux(stream.encode(None))
    with pytest.raises(InputError, match="no video stream but audio"):
        read_clock(path)


def test_two_rates_in_one_file_are_refused_by_name_and_place(tmp_path: Path) -> None:
    stamps = list(range(60)) + [60 + 8 * k for k in range(60)]
    path = write(tmp_path / "slow.mp4", [flat(99)] * 120, stamps=stamps, tick=Fraction(1, 240))
    with pytest.raises(InputError, match=r"slow.mp4: the video changes its rate at frame (59|60|61)"):
        read_clock(path)


def test_real_recording_has_even_times(shared_video: Path) -> None:
    frames, reader = read(shared_video)
    assert len(frames) == 200
    np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(200) / 30, atol=1e-9)
    assert reader.notices == ()


def test_of_several_streams_the_moving_picture_is_read(tmp_path: Path) -> None:
    """A small preview comes first, as some cameras write it."""
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as container:
        streams = [container.add_stream("ffv1", rate=30) for _ in range(2)]
        for stream, size in zip(streams, ((16, 16), SHAPE[::-1]), strict=True):
            stream.width, stream.height, stream.pix_fmt = *size, "gray"
        for k in range(5):
            for stream in streams:
                frame = av.VideoFrame.from_ndarray(np.full((stream.height, stream.width), 50 + k, np.uint8), "gray")
                frame.pts, frame.time_base = k, Fraction(1, 30)
                container.mux(stream.encode(frame))
        for stream in streams:
            container.mux(stream.encode(None))
    frames, _ = read(path)
    assert [frame.grey.shape for frame in frames] == [SHAPE] * 5
    assert [int(frame.grey[0, 0]) for frame in frames] == [50, 51, 52, 53, 54]


def test_pixels_that_are_not_square_are_stretched(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", [flat(99)] * 3, options={"x264-params": "sar=4/3"})
    frames, reader = read(path)
    assert frames[0].grey.shape == (66, 133)
    assert (reader.info.width, reader.info.height) == (133, 66)
    assert [notice.code for notice in reader.notices] == ["pixels_not_square"]


def interlaced(path: Path) -> Path:
    """A bright bar moves by 6 px from one field to the next."""
    images = []
    for k in range(8):
        image = np.full((96, 160), 40, np.uint8)
        for field in (0, 1):
            left = 20 + 6 * (2 * k + field)
            image[field::2, left : left + 16] = 200
        images.append(image)
    return write(path, images, options={"x264-params": "tff=1:qp=1"}, range="JPEG", form="yuvj420p")


def test_of_an_interlaced_video_one_field_is_used(tmp_path: Path) -> None:
    frames, reader = read(interlaced(tmp_path / "a.mkv"), full_range=False)
    assert [notice.code for notice in reader.notices] == ["interlaced"]
    for frame in frames:
        column = frame.grey[:, : 20 + 12 * frame.index + 14].astype(float)
        edge = 20 + 12 * frame.index
        assert np.all(column[:, edge + 2 :] > 150)  # no row of the other field
        assert np.all(column[:, : edge - 3] < 80)


def test_a_field_keeps_its_rows_where_they_were() -> None:
    grey = np.repeat(np.arange(0, 64, dtype=np.uint8)[:, None], 8, axis=1)
    shown = _take_field(grey)
    np.testing.assert_array_equal(shown[:63], grey[:63])  # identity: a ramp, linearly interpolated; the last row ends


def test_images_that_come_twice_are_known(tmp_path: Path) -> None:
    images = [flat(40), flat(40), flat(80), flat(120), flat(120), flat(120)]
    _, reader = read(write(tmp_path / "a.mkv", images, codec="ffv1", form="gray"))
    assert list(reader.repeated) == [False, True, False, False, True, True]


def test_names_with_signs_are_names(tmp_path: Path) -> None:
    path = write(tmp_path / "100%03d:x?.mp4", [flat(9)] * 3)
    assert len(read(path)[0]) == 3


@pytest.fixture
def shared_video() -> Path:
    path = Path(__file__).parents[2] / "shared" / "data" / "real" / "pushing_straight.mp4"
    if not path.exists():
        pytest.skip("the recording is not here")
    return path
