"""Where decoding can begin afresh: a film's runs of packets, which several decoders share out among them."""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, TypeVar

import numpy as np

from tagsway.model import IntArray

Packet = TypeVar("Packet")

_MOST_HELD_BYTES = 512 << 20  # images that may lie ready of the runs that follow: 250 of 1280 x 1024
_TOGETHER = 4  # images to a run where each is coded by itself
# How a unit's first byte tells its type, the types before which nothing is needed any more, and the parameter sets.
_FRESH = {"h264": (0x1F, 0, {5}, {7, 8}), "hevc": (0x7E, 1, {19, 20}, {33, 34})}
_UNIT = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Runs:
    """A film cut into runs of packets: what a run holds is decoded without any other.

    Parameters
    ----------
    starts : ndarray of int, shape (n,)
        Number of each run's first packet, rising from 0.
    packets : int
        Of the whole film.
    image_bytes : int
        Of one image, decoded.
    """

    starts: IntArray = field(default_factory=lambda: np.zeros(1, dtype=np.int64))
    packets: int = 0
    image_bytes: int = 0

    @property
    def longest(self) -> int:
        """Packets of the longest run."""
        return int(np.diff(self.starts, append=self.packets).max())

    def count_decoders(self, threads: int) -> int:
        """Return how many decoders to use of so many threads.

        While the images of one run are taken, those of the runs after it wait: there are no more decoders than the
        memory for that allows.
        """
        held = self.longest * self.image_bytes
        allowed = threads if held == 0 else 1 + _MOST_HELD_BYTES // held
        return max(min(threads, allowed, len(self.starts)), 1)


ONE_RUN = Runs()
"""A film in which nothing but its first packet is known to need no other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """Every so many-th run: what one of several decoders takes.

    Parameters
    ----------
    starts : tuple of int
        Of all runs.
    first, every : int
        The first run that is this decoder's, and how many decoders there are.
    """

    starts: tuple[int, ...] = (0,)
    first: int = 0
    every: int = 1

    def pick(self, packets: Iterable[Packet]) -> Iterator[Iterator[Packet]]:
        """Yield this share's runs of all the film's packets; each is to be taken before the next."""
        numbered = enumerate(packets)
        for run, group in groupby(numbered, key=lambda packet: bisect_right(self.starts, packet[0])):
            if (run - 1) % self.every == self.first:
                yield (packet for _, packet in group)


def share_out(runs: Runs, decoders: int) -> tuple[Share, ...]:
    """Return what each of some decoders takes: run after run in turn."""
    starts = tuple(runs.starts.tolist())
    return tuple(Share(starts=starts, first=first, every=decoders) for first in range(decoders))


def cut_evenly(packets: int, *, image_bytes: int = 0) -> Runs:
    """Return the runs of a film each of whose images is coded by itself."""
    starts = np.arange(0, max(packets, 1), _TOGETHER, dtype=np.int64)
    return Runs(starts=starts, packets=packets, image_bytes=image_bytes)


def recognise_fresh_start(codec: str, header: bytes) -> Callable[[Any], bool]:
    """Return what tells whether a packet needs none of those before it, nor any after it does.

    Parameters
    ----------
    codec : str
        FFmpeg's name. Only for H.264 and HEVC is the answer ever yes.
    header : bytes
        The codec's own ("extradata"): it says how a packet's units are told apart.

    Returns
    -------
    callable
        Takes an `av.Packet`.

    Notes
    -----
    A container's mark of a key image is not enough: images after it may still be made from some before it (open groups
    of pictures), and some files mark every one. An "instantaneous decoding refresh" is what both standards promise.
    Where parameter sets come between the images, and not in the header, it must come with its own: another decoder may
    have had those before.
    """
    if codec not in _FRESH:
        return lambda packet: False
    mask, shift, fresh, parameters = _FRESH[codec]
    place = {"h264": 4, "hevc": 21}[codec]
    size = (header[place] & 3) + 1 if len(header) > place and header[0] == 1 else 0

    def is_fresh(packet: Any) -> bool:
        if not packet.is_keyframe:
            return False
        firsts = _sized_units(bytes(packet), size) if size else _marked_units(bytes(packet))
        kinds = {(first & mask) >> shift for first in firsts}
        return bool(kinds & fresh) and (size > 0 or kinds >= parameters)

    return is_fresh


def _marked_units(content: bytes) -> Iterator[int]:
    """Yield the first byte of each unit that follows a mark."""
    return (found[1][0] for found in _UNIT.finditer(content))


def _sized_units(content: bytes, size: int) -> Iterator[int]:
    """Yield the first byte of each unit that follows its own length."""
    place = 0
    while place + size < len(content):
        yield content[place + size]
        place += size + int.from_bytes(content[place : place + size], "big")
