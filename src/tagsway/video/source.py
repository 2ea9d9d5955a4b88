"""What every kind of film tells: its stamps, and its images in order."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from tagsway.model import Coding, GreyArray, IntArray, Notice
from tagsway.video.runs import ONE_RUN, Runs, Share

Entry = tuple[int | None, Any]
"""A stamp, where there is one, and a picture."""

WHOLE = Share()
"""All of a film: what a decoder takes that is alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stamps:
    """What a source says of its frames' times, without decoding them.

    Parameters
    ----------
    ticks : ndarray of int, shape (n,)
        A stamp for each frame, in any order.
    tick_s : float
        Seconds to a tick; NaN where only the user knows the rate.
    is_count : bool
        True where a stamp is the number of a frame of an even clock: a missing number is a dropped frame.
    by_order : bool
        True where the images come without stamps: the k-th image belongs to the k-th stamp.
    header_hz : float or None
        The rate that the header states.
    captured_hz : float or None
        Capture rate in the metadata, beside stamps that are a playback's.
    runs : Runs
        What several decoders can share out among them.
    notices : tuple of Notice
        What to know of them.
    """

    ticks: IntArray
    tick_s: float
    is_count: bool = False
    by_order: bool = False
    header_hz: float | None = None
    captured_hz: float | None = None
    runs: Runs = ONE_RUN
    notices: tuple[Notice, ...] = ()


class Source(Protocol):
    """A film that can be read: its stamps first, then its images in order, as often as wanted.

    Attributes
    ----------
    turns : int
        Quarter turns, counter-clockwise, from the sensor's image to the upright one; known once an image was read.
    predicted : bool
        Whether a coder made the image that was read last from other images.
    coding : Coding
        How a coder did that.
    """

    turns: int
    predicted: bool
    coding: Coding

    def read_stamps(self) -> Stamps:
        """Return the stamps of all frames."""
        ...

    def decode(self, threads: int, share: Share = WHOLE) -> Iterator[Iterator[Entry]]:
        """Yield run by run the stamp, where it has one, and the picture of each frame; in a thread of its own."""
        ...

    def read_grey(self, picture: Any, *, full_range: bool) -> GreyArray:
        """Return a picture's grey image, upright."""
        ...

    def notices(self) -> tuple[Notice, ...]:
        """Return what was noticed of the pictures so far."""
        ...
