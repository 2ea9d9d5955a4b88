"""Numbered images as a film: a missing number is a dropped frame."""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tagsway.errors import InputError
from tagsway.model import UNKNOWN_CODING, GreyArray, IntArray, Notice
from tagsway.video.runs import Share, cut_evenly
from tagsway.video.source import WHOLE, Entry, Stamps

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".webp"})
_PATTERN = re.compile(r"^(?P<before>.*?)%0?(?P<width>\d*)d(?P<after>.*)$")
_NUMBERED = re.compile(r"^(?P<before>.*?)(?P<number>\d+)(?P<after>\.[A-Za-z]+)$")
_LOOK_AT = 8  # images, spread over the film, that tell how many of 16 bits are used


@dataclass(frozen=True, slots=True, kw_only=True)
class Sequence:
    """Images of one name but for a number.

    Parameters
    ----------
    folder : Path
        Where they are.
    before, after : str
        Their names around the number.
    width : int
        Digits of the number, filled with zeros; larger numbers take more.
    numbers : ndarray of int, shape (n,)
        Those that there are, rising.
    """

    folder: Path
    before: str
    after: str
    width: int
    numbers: IntArray

    def file(self, number: int) -> Path:
        """Return the image of a number."""
        return self.folder / f"{self.before}{number:0{self.width}d}{self.after}"

    def files(self) -> tuple[Path, ...]:
        """Return all images in order."""
        return tuple(self.file(int(number)) for number in self.numbers)


def find_sequence(path: Path) -> Sequence:
    """Return the images that a pattern or a folder stands for.

    Parameters
    ----------
    path : Path
        A pattern with one ``%d`` or ``%06d`` in the name, or a folder whose images differ in a number alone.

    Raises
    ------
    InputError
        Where there are none, or where a folder holds images of several names.
    """
    if path.is_dir():
        return _search_folder(path)
    found = _PATTERN.match(path.name)
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; expected one with numbered images")
    if found is None or "%" in found["after"]:
        raise InputError(f"{path}: expected one number in the pattern, such as frames/%06d.png")
    width = int(found["width"] or 1)
    digits = re.compile(re.escape(found["before"]) + r"(\d+)" + re.escape(found["after"]))
    texts = [match[1] for file in path.parent.iterdir() if (match := digits.fullmatch(file.name))]
    numbers = sorted(int(text) for text in texts if f"{int(text):0{width}d}" == text)
    if not numbers:
        raise InputError(f"{path}: no such images in {path.parent.resolve()}; expected files numbered like this")
    return Sequence(
        folder=path.parent,
        before=found["before"],
        after=found["after"],
        width=width,
        numbers=np.array(numbers, dtype=np.int64),
    )


def _search_folder(folder: Path) -> Sequence:
    """Return the images of a folder, where only one number tells them apart."""
    groups: dict[tuple[str, str], list[str]] = defaultdict(list)
    for file in folder.iterdir():
        if file.suffix.lower() not in SUFFIXES or file.name.startswith("."):
            continue
        found = _NUMBERED.match(file.name)
        groups[(found["before"], found["after"]) if found else (file.stem, file.suffix)].append(
            found["number"] if found else ""
        )
    if not groups:
        raise InputError(f"{folder} is a folder without images: expected a video, or a folder of numbered images")
    (before, after), texts = max(groups.items(), key=lambda group: len(group[1]))
    width = min(len(text) for text in texts)
    if len(groups) > 1 or any(f"{int(text or 0):0{width}d}" != text for text in texts):
        example = before + ("%d" if width < 2 else f"%0{width}d") + after
        raise InputError(
            f"{folder} is a folder with images of several names: expected images that differ in a number alone; "
            f"give a pattern such as {folder / example}"
        )
    numbers = np.sort(np.array([int(text) for text in texts], dtype=np.int64))
    return Sequence(folder=folder, before=before, after=after, width=width, numbers=numbers)


class SequenceSource:
    """The film of a sequence of images; see `Source`."""

    turns = 0
    predicted = False
    coding = UNKNOWN_CODING

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence
        self._bits = 0

    def read_stamps(self) -> Stamps:
        """Return the numbers; when the images were taken they do not say."""
        numbers = self._sequence.numbers
        return Stamps(ticks=numbers, tick_s=float("nan"), is_count=True, runs=cut_evenly(len(numbers)))

    def decode(self, threads: int, share: Share = WHOLE) -> Iterator[Iterator[Entry]]:
        """Yield number and image, as it is stored, of every file that can be read."""
        self._bits = self._bits or self._measure_bits()
        for run in share.pick(self._sequence.numbers.tolist()):
            yield self._read(run)

    def _read(self, numbers: Iterable[int]) -> Iterator[Entry]:
        for number in numbers:
            picture = _read_image(self._sequence.file(number))
            if picture is not None:
                yield number, picture

    def read_grey(self, picture: Any, *, full_range: bool) -> GreyArray:
        """Return the image in 8 bits."""
        if picture.dtype == np.uint8:
            return np.asarray(picture)
        return np.asarray(cv2.convertScaleAbs(picture, alpha=2.0 ** (8 - self._bits)), dtype=np.uint8)

    def notices(self) -> tuple[Notice, ...]:
        """Return nothing: unreadable images are counted by whoever reads."""
        return ()

    def _measure_bits(self) -> int:
        """Return how many bits the images use."""
        numbers = self._sequence.numbers
        chosen = numbers[np.unique(np.linspace(0, len(numbers) - 1, _LOOK_AT).astype(int))]
        images = [image for number in chosen if (image := _read_image(self._sequence.file(int(number)))) is not None]
        return _hold_bits(max((int(image.max()) for image in images), default=0))


def _read_image(file: Path) -> Any:
    """Return an image in grey, of 8 or 16 bits; None where it cannot be read."""
    try:
        content = np.fromfile(file, dtype=np.uint8)
        image = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH) if content.size else None
    except (OSError, cv2.error):
        return None
    return image if image is not None and image.dtype in (np.uint8, np.uint16) else None


def _hold_bits(largest: int) -> int:
    """Return to how many bits a sensor's values go whose largest is given: 8, 10, 12, 14 or 16.

    A camera writes 12 bits into files of 16 at either end; what is never reached is not used.
    """
    return next((bits for bits in (8, 10, 12, 14) if largest < 1 << bits), 16)
