"""Decode ahead: one decoder or several, in threads of their own, whose images come out in order."""

import threading
import time
from collections.abc import Sequence
from queue import Empty, SimpleQueue
from typing import Any

from tagsway.video.runs import Share
from tagsway.video.source import Entry, Source

_FIRST_PLACES = 4  # images that may wait until the first one's size is known ...
_MOST_QUEUED_PX = 48 << 20  # ... and what all that wait may hold: 72 MB with their colours, 38 images of 1280 x 1024
_AT_ONCE = 4  # images handed over together where decoders leave the tracker no core of its own: each time wakes it
_NAP_S, _NAPS = 3e-4, 12  # between looks for an image, before waiting to be woken: that costs the decoder 0.03 ms
_END_OF_RUN = object()

Places = SimpleQueue[None]
"""Room for images that wait: taken before one is decoded on, given back as it is read."""


class DecodedAhead:
    """The images of a film in their order, from decoders that run ahead.

    Parameters
    ----------
    sources : sequence of Source
        The film as often as there are decoders.
    shares : sequence of Share
        What each of them takes: see `tagsway.video.runs.share_out`.
    threads : int
        Of all decoders together.
    queue_frames : int
        Images that may wait, shared out among the decoders, of which each has at least one and at first up to four.
    later_frames : int
        Images that may wait beside these, of whichever run.

    Notes
    -----
    Of the places that all share a decoder takes one where it can, else of its own: these come back as its images are
    read, so that the one whose turn it is never waits for the others'.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        shares: Sequence[Share],
        *,
        threads: int,
        queue_frames: int,
        later_frames: int,
    ) -> None:
        # What waits, and the places for it: a C queue each, for a lock of Python's costs the tracker its time.
        self._queues: list[SimpleQueue[Any]] = [SimpleQueue() for _ in sources]
        self._own: list[Places] = [SimpleQueue() for _ in sources]
        self._shared: Places = SimpleQueue()
        self._later_frames = later_frames
        self._queue_frames = max(queue_frames, 1)
        self._allow(min(self._queue_frames, _FIRST_PLACES))
        self._handed: list[Any] = []
        self._turn = 0
        self._at_once = 1 if threads == 1 else _AT_ONCE
        self._stopped = self._started = False
        self._threads = [
            threading.Thread(
                target=self._decode,
                args=(k, source, max(threads // len(sources), 1), share),
                name=f"decoder {k + 1}",
                daemon=True,
            )
            for k, (source, share) in enumerate(zip(sources, shares, strict=True))
        ]

    def allow(self, image_px: int) -> None:
        """Let as many images wait as there is memory for, once their size is known."""
        count = min(self._queue_frames, _MOST_QUEUED_PX // image_px) // len(self._own)
        self._allow(count - _FIRST_PLACES)
        for _ in range(self._later_frames):
            self._shared.put(None)

    def take(self) -> Entry | None:
        """Return the next image, or None after the last; raise what stopped its decoder."""
        if not self._started:
            self._started = True
            for thread in self._threads:
                thread.start()
        while not self._stopped:
            if not self._handed:
                self._handed = _wait_for(self._queues[self._turn])
                self._handed.reverse()
            entry = self._handed.pop()
            if entry is _END_OF_RUN:
                self._turn = (self._turn + 1) % len(self._queues)
            elif entry is None:
                self.close()
            elif isinstance(entry, BaseException):
                self.close()
                raise entry
            else:
                places, image = entry
                places.put(None)
                taken: Entry = image
                return taken
        return None

    def close(self) -> None:
        """Stop decoding and wait for the threads; images that were taken stay valid."""
        self._stopped = True
        for places in self._own:
            places.put(None)
        if self._started:
            for thread in self._threads:
                thread.join()
        self._queues = [SimpleQueue() for _ in self._queues]
        self._handed = []

    def _allow(self, more: int) -> None:
        for places in self._own:
            for _ in range(more):
                places.put(None)

    def _decode(self, number: int, source: Source, threads: int, share: Share) -> None:
        """Decode until the end, or until told to stop; what comes last is None or an error."""
        hand, own = self._queues[number].put, self._own[number]
        entries: list[Any] = []
        try:
            for run in source.decode(threads, share):
                for image in run:
                    places = self._shared
                    try:
                        places.get_nowait()
                    except Empty:
                        places = own
                        if entries and own.empty():
                            hand(entries)
                            entries = []
                        own.get()
                    if self._stopped:
                        return
                    entries.append((places, image))
                    del image  # its memory, still in the cache, is what a later image is decoded into
                    if len(entries) == self._at_once:
                        hand(entries)
                        entries = []
                hand([*entries, _END_OF_RUN])
                entries = []
            entries.append(None)
        except Exception as error:
            entries.append(error)
        hand(entries)


def _wait_for(queue: SimpleQueue[Any]) -> Any:
    """Return what comes next: at first by looking now and then, so that who brings it need wake nobody."""
    for _ in range(_NAPS):
        try:
            return queue.get_nowait()
        except Empty:
            time.sleep(_NAP_S)
    return queue.get()
