"""Photron's raw films: .mraw with the images, and .cihx or .cih beside it, which says what they are."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np

from tagsway.errors import InputError
from tagsway.model import UNKNOWN_CODING, GreyArray, Notice
from tagsway.video.runs import Share
from tagsway.video.source import WHOLE, Entry, Stamps

SUFFIXES = frozenset({".mraw", ".cihx", ".cih"})

_KEYS = {
    "width": ("imageDataInfo/resolution/width", "Image Width"),
    "height": ("imageDataInfo/resolution/height", "Image Height"),
    "bits": ("imageDataInfo/colorInfo/bit", "Color Bit"),
    "used_bits": ("imageDataInfo/effectiveBit/depth", "EffectiveBit Depth"),
    "side": ("imageDataInfo/effectiveBit/side", "EffectiveBit Side"),
    "rate": ("recordInfo/recordRate", "Record Rate(fps)"),
    "frames": ("frameInfo/totalFrame", "Total Frame"),
}
"""Where the two kinds of header hold the same: the path of an element, the name before a colon."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    width: int
    height: int
    bits: int
    used_bits: int
    is_low: bool
    rate_hz: float
    frames: int

    @property
    def frame_bytes(self) -> int:
        return self.width * self.height * self.bits // 8


def find_pair(path: Path) -> tuple[Path, Path]:
    """Return the file with the images and the one with their description, given either."""
    here = {file.suffix.lower(): file for file in path.parent.iterdir() if file.stem == path.stem}
    images, header = here.get(".mraw"), here.get(".cihx", here.get(".cih"))
    if images is None or header is None:
        missing = ".mraw" if images is None else ".cihx or .cih"
        raise InputError(f"{path}: there is no {path.stem}{missing} beside it; expected both, as the camera wrote them")
    return images, header


class PhotronSource:
    """The film of a Photron camera; see `Source`. Its images are grey, of 8, 12 (packed) or 16 bits."""

    turns = 0
    predicted = False
    coding = UNKNOWN_CODING

    def __init__(self, path: Path) -> None:
        self._path, header = find_pair(path)
        self._header = _read_header(header)

    def read_stamps(self) -> Stamps:
        """Return the numbers of the frames that the file really holds, and the rate at which they were taken."""
        held = self._path.stat().st_size // self._header.frame_bytes
        count = min(held, self._header.frames)
        words = f"the file ends after {count} frames of {self._header.frames}: the rest is lost"
        return Stamps(
            ticks=np.arange(count),
            tick_s=1 / self._header.rate_hz,
            is_count=True,
            notices=() if count == self._header.frames else (Notice(code="truncated", message=words),),
        )

    def decode(self, threads: int, share: Share = WHOLE) -> Iterator[Iterator[Entry]]:
        """Yield number and bytes of each image."""
        yield from share.pick(self._read())

    def _read(self) -> Iterator[Entry]:
        with self._path.open("rb") as file:
            for number in range(self._header.frames):
                content = file.read(self._header.frame_bytes)
                if len(content) < self._header.frame_bytes:
                    return
                yield number, content

    def read_grey(self, picture: Any, *, full_range: bool) -> GreyArray:
        """Return the image in 8 bits."""
        header = self._header
        if header.bits == 16:
            words = np.frombuffer(picture, "<u2").reshape(header.height, header.width)
            spare = header.used_bits - 8 if header.is_low else 8
            return np.asarray(cv2.convertScaleAbs(words, alpha=2.0**-spare), dtype=np.uint8)
        grey = np.frombuffer(picture, np.uint8)
        if header.bits == 12:  # two pixels in three bytes, the high bits first
            first, middle, last = grey.reshape(-1, 3).T
            grey = np.stack([first, (middle << 4) | (last >> 4)], axis=1)
        return grey.reshape(header.height, header.width)

    def notices(self) -> tuple[Notice, ...]:
        """Return nothing: raw images cannot be damaged but by an early end."""
        return ()


def _read_header(path: Path) -> _Header:
    content = path.read_bytes()
    xml = re.search(rb"<cih>.*</cih>", content, re.DOTALL)
    try:
        if xml:
            tree = ElementTree.fromstring(xml[0].decode("utf-8", "replace"))
            values = {name: tree.findtext(place) for name, (place, _) in _KEYS.items()}
        else:
            lines = dict(re.findall(r"^([^:\r\n]+?) : (.*?)\r?$", content.decode("utf-8", "replace"), re.MULTILINE))
            values = {name: lines.get(key) for name, (_, key) in _KEYS.items()}
    except ElementTree.ParseError as error:
        raise InputError(f"{path} is no camera's description ({error}): copy it again from the camera") from None
    missing = [name for name in ("width", "height", "bits", "rate", "frames") if not values[name]]
    if missing:
        raise InputError(f"{path} does not say {', '.join(missing)}: expected a Photron camera's description")
    try:
        header = _Header(
            width=int(values["width"] or 0),
            height=int(values["height"] or 0),
            bits=int(values["bits"] or 0),
            used_bits=int(values["used_bits"] or values["bits"] or 0),
            is_low=(values["side"] or "lower").strip().lower() == "lower",
            rate_hz=float(values["rate"] or 0),
            frames=int(values["frames"] or 0),
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}; expected a Photron camera's description") from None
    if header.bits not in (8, 12, 16):
        raise InputError(f"{path}: images of {header.bits} bits; expected grey ones of 8, 12 or 16: export it as tiff")
    positive = (header.width, header.height, header.rate_hz, header.frames)
    if not all(0 < value < math.inf for value in positive) or not 8 <= header.used_bits <= 16:
        raise InputError(
            f"{path}: {header.frames} images of {header.width} x {header.height} pixels at {header.rate_hz:g} Hz, "
            f"{header.used_bits} bits used: expected positive numbers, and 8 to 16 bits"
        )
    return header
