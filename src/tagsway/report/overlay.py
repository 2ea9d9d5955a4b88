"""The video again, with what was seen in it: the tags, their tracks, the window and the time."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib
import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFont

from tagsway.model import FloatArray, Frame, GreyArray, Progress, Result, Sightings, TagSightings, Track, Window
from tagsway.report.style import DARK_PALETTE, drawn_length, shown_range
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.writing import write_video

MOST_FPS = 60.0
"""What a screen shows; a faster film is slowed down by a whole number, so that no frame is left out."""

LARGEST_SIDE_PX, SMALLEST_SIDE_PX = 1920, 480
"""A larger image is made smaller, for a browser; a smaller one larger, for the words."""

TAIL_S = 0.5
QUALITY = 21.0

PAPER, DIM, LETTERS = DARK_PALETTE["@paper"], DARK_PALETTE["@grey"], DARK_PALETTE["@ink"]
PLACES = {"TCP": DARK_PALETTE["@blue"], "PCP": DARK_PALETTE["@orange"], "reference": DARK_PALETTE["@green"]}
"""The tags' names and colours: the page's on a dark ground."""

MOVE, FREE = PLACES["TCP"], DARK_PALETTE["@green"]


def write_overlay(
    path: Path,
    video: Path,
    *,
    result: Result,
    sightings: Sightings,
    track: Track,
    move: Window | None = None,
    progress: Progress | None = None,
) -> int:
    """Write a video of what was seen: each frame with its tags, their tracks, the time and the sway so far.

    Parameters
    ----------
    path : Path
        An .mp4 (H.264, as browsers play it), written whole or not at all.
    video : Path
        The file that was measured.
    result : Result
        Its result, for the tags' ids and the window.
    sightings : Sightings
        The tags in the video's own pixels; a tag that was not seen is not drawn, and said to be lost.
    track : Track
        The same tags in the plane of the motion, for the sway below the image.
    move : Window, optional
        When the tool moved.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    int
        How many frames were written: all that were tracked, each once. A film of more than 60 fps becomes slow motion,
        by a whole number.

    Raises
    ------
    InputError
        Where the video cannot be read any more, or the overlay not be written.
    """
    settings, info = result.source.settings, sightings.video
    ids = {"TCP": settings.tcp_id, "PCP": settings.pcp_id, "reference": settings.reference_id}
    places = {name: tag_id for name, tag_id in ids.items() if tag_id is not None}
    slower = max(1, math.ceil(info.fps_hz / MOST_FPS - 0.01))
    painter = _Painter(
        layout=_Layout.of(info.width, info.height),
        time_s=sightings.time_s,
        tags={name: sightings.tag(tag_id) for name, tag_id in places.items()},
        sway=_sway(track),
        unit=drawn_length(track.length_unit)[1],
        window=result.window,
        move=move,
        slower=slower,
    )

    def painted() -> Iterator[GreyArray]:
        with read_frames(video, read_clock(video, fps_hz=settings.fps_hz)) as frames:
            for done, frame in enumerate(frames, start=1):
                place = int(np.searchsorted(sightings.frame, frame.index))
                if place < len(sightings.frame) and sightings.frame[place] == frame.index:
                    yield painter.paint(frame, place)
                if progress is not None:
                    progress(done, info.frames)

    time_s = slower * (sightings.time_s - sightings.time_s[0])
    return write_video(path, painted(), fps_hz=info.fps_hz / slower, time_s=time_s, quality=QUALITY, full_range=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Layout:
    """Where everything is, in pixels of the overlay: the image, below it the words, the sway, and the bar."""

    scale: float
    width: int
    image_height: int
    height: int
    letter: int

    @classmethod
    def of(cls, width: int, height: int) -> "_Layout":
        scale = min(max(1.0, SMALLEST_SIDE_PX / min(width, height)), LARGEST_SIDE_PX / max(width, height))
        wide, high = (2 * round(scale * side / 2) for side in (width, height))
        letter = max(15, round(0.031 * min(wide, high)))
        return cls(scale=scale, width=wide, image_height=high, height=2 * ((high + 10 * letter) // 2), letter=letter)

    @property
    def line(self) -> int:
        return max(2, round(self.letter / 11))

    @property
    def plot(self) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of the sway."""
        return self.letter, self.image_height + 2 * self.letter, self.width - self.letter, self.height - 2 * self.letter

    def place(self, points_px: FloatArray) -> FloatArray:
        """Return where points of the video are drawn."""
        return self.scale * (points_px + 0.5) - 0.5


class _Painter:
    """Paints one frame after the other; of any length it holds one strip and one image of the track so far."""

    def __init__(
        self,
        *,
        layout: _Layout,
        time_s: FloatArray,
        tags: dict[str, TagSightings | None],
        sway: FloatArray,
        unit: str,
        window: Window | None,
        move: Window | None,
        slower: int,
    ) -> None:
        self._layout, self._time, self._tags, self._sway, self._unit = layout, time_s, tags, sway, unit
        self._window, self._move, self._slower = window, move, slower
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._font = ImageFont.truetype(fonts / "DejaVuSans.ttf", layout.letter)
        self._strip = self._draw_strip()
        self._traced = np.zeros((layout.image_height, layout.width), dtype=np.uint8)
        self._trace_colour = np.full((*self._traced.shape, 3), _rgb(PLACES["PCP"]), dtype=np.uint8)

    def paint(self, frame: Frame, k: int) -> GreyArray:
        """Return a frame, the k-th of the track, with all that is drawn on it and below it."""
        layout = self._layout
        size = (layout.width, layout.image_height)
        grey = (
            frame.grey
            if layout.scale == 1
            else cv2.resize(frame.grey, size, interpolation=cv2.INTER_AREA if layout.scale < 1 else cv2.INTER_LINEAR)
        )
        canvas: GreyArray = self._strip.copy()
        image = canvas[: layout.image_height]
        cv2.cvtColor(np.ascontiguousarray(grey[: size[1], : size[0]]), cv2.COLOR_GRAY2RGB, dst=image)
        self._draw_trace(image, k)
        first = int(np.searchsorted(self._time, self._time[k] - TAIL_S))
        for name, tag in self._tags.items():
            if tag is not None:
                self._draw_tail(image, layout.place(tag.centre_px[first : k + 1]), PLACES[name])
                if tag.seen[k]:
                    self._draw_tag(image, name, layout.place(tag.corners_px[k]))
        self._write_words(canvas, k)
        self._draw_cursor(canvas, k)
        return canvas

    def _draw_tag(self, image: GreyArray, name: str, corners: FloatArray) -> None:
        outline, line = _fixed(corners), self._layout.line
        for colour, thickness in ((PAPER, 3 * line), (PLACES[name], line)):
            cv2.polylines(image, [outline], True, _rgb(colour), thickness, cv2.LINE_AA, _SHIFT)
        left, top = corners.min(axis=0)
        self._write(image, name, int(left), int(top) - 2 * self._layout.letter, PLACES[name], ground=True)

    def _draw_tail(self, image: GreyArray, centres: FloatArray, colour: str) -> None:
        for part in _seen_parts(centres):
            for shade, thickness in ((PAPER, 3 * self._layout.line), (colour, self._layout.line)):
                cv2.polylines(image, [_fixed(part)], False, _rgb(shade), thickness, cv2.LINE_AA, _SHIFT)

    def _draw_trace(self, image: GreyArray, k: int) -> None:
        """Draw the product's track through the window so far, thin, under everything else."""
        tag, window = self._tags["PCP"], self._window
        if tag is None or window is None or self._time[k] < window.start_s:
            return
        if k and window.start_s <= self._time[k - 1] and self._time[k] <= window.end_s:
            step = self._layout.place(tag.centre_px[k - 1 : k + 1])
            if np.isfinite(step).all():
                cv2.polylines(self._traced, [_fixed(step)], False, 255, 1, cv2.LINE_8, _SHIFT)
        cv2.copyTo(self._trace_colour, self._traced, image)

    def _draw_strip(self) -> GreyArray:
        """Return the canvas with all that stays: ground, spans of move and window, the sway over the whole time."""
        layout = self._layout
        canvas: GreyArray = np.full((layout.height, layout.width, 3), _rgb(PAPER), dtype=np.uint8)
        left, top, right, bottom = layout.plot
        bar = bottom + layout.letter // 4
        canvas[bar : bar + layout.letter // 2, left:right] = _mix(DIM, 0.35)
        for span, colour in ((self._move, MOVE), (self._window, FREE)):
            if span is not None:
                first, last = self._column(span.start_s), max(self._column(span.end_s), self._column(span.start_s) + 1)
                canvas[top:bottom, first:last] = _mix(colour, 0.22)
                canvas[bar : bar + layout.letter // 2, first:last] = _rgb(colour)
        self._write(canvas, f"{self._time[0]:.2f} s", left, bar + round(0.55 * layout.letter), DIM)
        self._write(canvas, f"{self._time[-1]:.2f} s", right, bar + round(0.55 * layout.letter), DIM, from_right=True)
        points = np.stack([self._column_of(self._time), self._row_of(self._sway)], axis=1)
        for part in _seen_parts(points):
            cv2.polylines(canvas, [_fixed(part)], False, _rgb(PLACES["PCP"]), layout.line + 1, cv2.LINE_AA, _SHIFT)
        return canvas

    def _draw_cursor(self, canvas: GreyArray, k: int) -> None:
        layout, column = self._layout, self._column(self._time[k])
        cv2.line(
            canvas,
            (column, layout.plot[1]),
            (column, layout.plot[3] + 3 * layout.letter // 4),
            _rgb(LETTERS),
            layout.line,
        )
        if np.isfinite(self._sway[k]):
            row = round(float(self._row_of(self._sway[k : k + 1])[0]))
            cv2.circle(canvas, (column, row), 3 * layout.line, _rgb(LETTERS), -1, cv2.LINE_AA)

    def _write_words(self, canvas: GreyArray, k: int) -> None:
        layout = self._layout
        row = layout.image_height + layout.letter // 3
        words = f"{self._time[k]:.3f} s   frame {k + 1}/{len(self._time)}"
        after = self._write(canvas, words, layout.letter, row, LETTERS)
        phase, colour = self._phase(float(self._time[k]))
        after = self._write(canvas, phase, after + layout.letter, row, colour)
        if np.isfinite(self._sway[k]):
            sway = f"sway x {self._sway[k]:+.1f} {self._unit}".replace("-", "−")
            self._write(canvas, sway, layout.width - layout.letter, row, PLACES["PCP"], from_right=True)
        row = layout.letter // 2
        if self._slower > 1:
            slow = f"slow motion 1/{self._slower}"
            self._write(canvas, slow, layout.width - layout.letter, row, LETTERS, from_right=True, ground=True)
        for name, tag in self._tags.items():
            if tag is None or not tag.seen[k]:
                self._write(canvas, f"{name} lost", layout.letter, row, PLACES[name], ground=True)
                row += round(1.6 * layout.letter)

    def _phase(self, time_s: float) -> tuple[str, str]:
        for name, span, colour in (("move", self._move, MOVE), ("free decay", self._window, FREE)):
            if span is not None and span.start_s <= time_s <= span.end_s:
                return name, colour
        return "", DIM

    def _write(
        self,
        canvas: GreyArray,
        text: str,
        x: int,
        y: int,
        colour: str,
        *,
        from_right: bool = False,
        ground: bool = False,
    ) -> int:
        """Write a line from the left (or the right) of x, below y, as far as it fits; return where it ends."""
        letter = self._layout.letter
        margin = letter // 4
        box = round(self._font.getlength(text)) + 2 * margin, round(1.4 * letter)
        x = int(np.clip(x - box[0] if from_right else x, 0, max(canvas.shape[1] - box[0], 0)))
        y = int(np.clip(y, 0, canvas.shape[0] - box[1]))
        under = canvas[y : y + box[1], x : x + box[0]]
        mask = Image.new("L", box)
        ImageDraw.Draw(mask).text((margin, margin // 2), text, fill=255, font=self._font)
        share = np.asarray(mask, dtype=np.float32)[: under.shape[0], : under.shape[1], None] / 255
        shown = 0.35 * under + 0.65 * np.array(_rgb(PAPER)) if ground else under
        under[:] = (shown * (1 - share) + np.array(_rgb(colour)) * share).astype(np.uint8)
        return x + box[0]

    def _column(self, time_s: float) -> int:
        return round(float(self._column_of(np.array([time_s]))[0]))

    def _column_of(self, time_s: FloatArray) -> FloatArray:
        left, _, right, _ = self._layout.plot
        start, end = self._time[0], self._time[-1]
        columns: FloatArray = left + (right - left) * np.clip((time_s - start) / max(end - start, 1e-9), 0, 1)
        return columns

    def _row_of(self, sway: FloatArray) -> FloatArray:
        _, top, _, bottom = self._layout.plot
        low, high = shown_range([], [self._sway]) or (-1.0, 1.0)
        rows: FloatArray = bottom - (bottom - top) * np.clip((sway - low) / (high - low), 0, 1)
        return rows


_SHIFT = 4
"""Bits behind the point in the coordinates that OpenCV draws."""


def _fixed(points: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
    fixed: np.ndarray[tuple[int, ...], np.dtype[np.int32]] = np.rint(points * 2**_SHIFT).astype(np.int32)
    return fixed.reshape(-1, 1, 2)


def _seen_parts(points: FloatArray) -> list[FloatArray]:
    """Return the runs of points between those that are not known."""
    known = np.isfinite(points).all(axis=1)
    edges = np.flatnonzero(np.diff(known)) + 1
    return [part for part in np.split(points, edges) if np.isfinite(part[:1]).all() and len(part)]


def _sway(track: Track) -> FloatArray:
    """Return the product's x relative to the tool (or to its own middle) as it is drawn: in mm, or pixels."""
    x = track.pcp.position[:, 0]
    zero = np.nanmedian(x) if track.tcp is None and np.isfinite(x).any() else 0.0
    sway: FloatArray = x - (zero if track.tcp is None else track.tcp.position[:, 0])
    return drawn_length(track.length_unit)[0] * sway


def _rgb(colour: str) -> tuple[int, ...]:
    return ImageColor.getrgb(colour)


def _mix(colour: str, share: float) -> tuple[int, ...]:
    """Return a colour laid over the ground."""
    return tuple(round(share * c + (1 - share) * p) for c, p in zip(_rgb(colour), _rgb(PAPER), strict=True))
