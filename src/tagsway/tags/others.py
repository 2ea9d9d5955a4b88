"""Which tags are in the images after all, when the wanted ones are not: looked for in a process of its own.

A detector holds one family, and a process should hold one detector; so the search among all families runs in a child,
``python -m tagsway.tags.others``, which reads the images as one .npy from standard input and writes JSON.
"""

import io
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np

from tagsway.model import GreyArray
from tagsway.tags.families import FAMILIES
from tagsway.tags.find import TagFinder

_SURE_MARGIN = 35.0  # with so many ids any clutter is one of them: only what is read without a correction


def find_other_tags(greys: Sequence[GreyArray], *, timeout_s: float = 60.0) -> tuple[tuple[str, int], ...]:
    """Return family and id of every tag in a few images, most frequent first.

    Parameters
    ----------
    greys : sequence of ndarray of uint8, shape (height, width)
        A handful of images of one size, spread over the video.
    timeout_s : float
        For the whole search.

    Returns
    -------
    tuple of (family, id)
        Empty where nothing is seen, and where the child process cannot work: it only serves an error's words.
    """
    if not greys:
        return ()
    images = io.BytesIO()
    np.save(images, np.stack(greys), allow_pickle=False)
    command = [sys.executable, "-m", "tagsway.tags.others"]
    try:
        done = subprocess.run(command, input=images.getvalue(), capture_output=True, timeout=timeout_s, check=True)
        return tuple((str(family), int(tag_id)) for family, tag_id in json.loads(done.stdout))
    except (OSError, subprocess.SubprocessError, ValueError):
        return ()


def list_tags(greys: Sequence[GreyArray]) -> list[tuple[str, int]]:
    """Return family and id of the tags in some images, in this process; see `find_other_tags`.

    Parameters
    ----------
    greys : sequence of ndarray of uint8, shape (height, width)
        The images; a tag must be in a third of them.

    Returns
    -------
    list of (family, id)
        Most frequent first.
    """
    seen: Counter[tuple[str, int]] = Counter()
    for family in FAMILIES:
        finder = TagFinder(family)
        for grey in greys:
            sure = (tag for tag in finder.find(grey) if tag.hamming == 0 and tag.margin >= _SURE_MARGIN)
            seen.update({(family, tag.tag_id) for tag in sure})
    return [tag for tag, count in seen.most_common() if 3 * count >= len(greys)]


if __name__ == "__main__":
    json.dump(list_tags(list(np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False))), sys.stdout)
