"""How much memory a video takes while it is tracked: as much for half an hour as for a minute, beside the track.

    python benchmarks/memory.py [--fps 30] [--short 60] [--long 1800]

One second of a film is coded and its packets repeated, so that the long file costs no time to make. Each length is
tracked in a process of its own, whose peak is asked from the system.
"""

import argparse
import math
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np

from tagsway.model import GreyArray, Settings
from tagsway.pipeline.recording import Film, track_video

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import make_pose, see_tag

WIDTH, HEIGHT = 320, 240
KILOBYTE = 1024


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--fps", type=int, default=30)
    parser.add_argument("--short", type=int, default=60, help="seconds")
    parser.add_argument("--long", type=int, default=1800, help="seconds")
    parser.add_argument("--track", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.track:
        print(*measure(options.track))
        return
    with tempfile.TemporaryDirectory() as folder:
        second = Path(folder) / "second.mp4"
        write_second(second, options.fps)
        peaks = {}
        for seconds in (options.short, options.long):
            path = Path(folder) / f"{seconds}.mp4"
            loop(second, path, seconds, options.fps)
            peaks[seconds] = run(path)
            size, track, frames = peaks[seconds]
            print(
                f"{seconds} s, {frames} frames: peak {size / KILOBYTE**2:.1f} MB, of which the sightings "
                f"{track / KILOBYTE**2:.1f} MB, {track / frames:.0f} bytes a frame of two tags",
                flush=True,
            )
    (short, short_track, few), (long, long_track, many) = peaks[options.short], peaks[options.long]
    beside = (long - long_track) / (short - short_track)
    print(
        f"long / short: peak {long / short:.2f}, beside the sightings {beside:.2f}; "
        f"{(long - short) / (many - few):.0f} bytes of peak a frame"
    )


def write_second(path: Path, fps: int) -> None:
    """Code one second in which two tags swing once, so that it can follow itself."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=fps, options={"crf": "18", "bf": "0", "g": str(fps)})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for k, image in enumerate(draw(fps)):
            picture = av.VideoFrame.from_ndarray(image, format="gray")
            picture.pts = k
            container.mux(stream.encode(picture.reformat(format="yuv420p")))
        container.mux(stream.encode(None))


def draw(fps: int) -> Iterator[GreyArray]:
    """Draw the images of that second."""
    noise = np.random.default_rng(0).normal(scale=2.0, size=(4, HEIGHT, WIDTH))
    for k in range(fps):
        swing = 0.2 * math.sin(2 * math.pi * k / fps)
        places = ((160.0, 60.0), (160 + 110 * math.sin(swing), 60 + 110 * math.cos(swing)))
        image = np.full((HEIGHT, WIDTH), 120.0)
        for tag_id, (place, angle) in enumerate(zip(places, (0.0, swing), strict=True)):
            image = see_tag(make_pose(place, 40.0, angle), image.shape, tag_id=tag_id, onto=image)
        yield np.clip(np.rint(image + noise[k % 4]), 0, 255).astype(np.uint8)


def loop(source: Path, path: Path, seconds: int, fps: int) -> None:
    """Write a second's packets again and again, each with its own stamp."""
    with av.open(str(source)) as given, av.open(str(path), "w") as container:
        old = given.streams.video[0]
        new = container.add_stream_from_template(old)
        packets = [bytes(packet) for packet in given.demux(old) if packet.size]
        for second in range(seconds):
            for k, content in enumerate(packets):
                packet = av.Packet(content)
                packet.stream, packet.time_base = new, old.time_base
                packet.pts = packet.dts = round((second * fps + k) / fps / old.time_base)
                packet.is_keyframe = k == 0
                container.mux(packet)


def run(path: Path) -> tuple[int, int, int]:
    """Return peak memory and the sightings' size in bytes, and how many frames, of a process that tracks a file."""
    command = [sys.executable, __file__, "--track", str(path)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    peak, track, frames = (int(word) for word in done.stdout.split())
    return peak, track, frames


def measure(path: Path) -> tuple[int, int, int]:
    """Track a file; return this process' peak, the sightings' bytes, and the frames."""
    film = track_video(path, Settings())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KILOBYTE
    return peak, count_bytes(film), len(film.sightings.frame)


def count_bytes(film: Film) -> int:
    """Return the size of the arrays of what is kept."""
    sightings = film.sightings
    arrays = [sightings.frame, sightings.time_s]
    for tag in sightings.tags:
        arrays += [tag.centre_px, tag.covariance_px2, tag.corners_px, tag.angle_rad, tag.angle_std_rad, tag.correlation]
    return sum(array.nbytes for array in arrays)


if __name__ == "__main__":
    main()
