"""From a track to the one signal that is fitted: the sway along its path."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.filters import find_image_noise
from tagsway.model import BoolArray, FloatArray, IntArray, TagTrack, Track, Window

MAD_TO_STD = 1.4826
"""A normal distribution's standard deviation over its median absolute deviation."""


DRIVEN = 2.0
"""Standard deviation of the tool's position over its noise from which its motion is tried as an input."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sway:
    """PCP minus TCP along the path of the sway, at the samples that exist.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, not necessarily even.
    value : ndarray, shape (n,)
        Way along the path in the track's length unit; its zero is arbitrary.
    spread : ndarray, shape (n,)
        Standard error of each sample over that of the median one.
    stated_std : float
        Standard error that the images' own noise leaves in the record's best samples, as the track states it, in the
        track's length unit; 0 where it states none. What comes on top of it is a codec's.
    pulled_std : float
        Standard error that a coder left in the window's samples, as the track states it; it lasts for many of them.
    curvature : float
        Of the path, in 1 / length unit; 0 where it is straight within the errors. The value is then the projection on
        the main axis, else the arc's length.
    curvature_std : float
        Its standard error.
    planar : bool
        Whether both coordinates were seen, so that a curved path would have shown; an angle shows its path, too.
    common : ndarray, shape (n, k), or None
        What one standard error of each thing that errs for all samples together does to the value.
    angular : bool
        Whether the value is an angle in rad: the path's curvature is 1, and nothing is projected.
    projected : bool
        Whether it is one coordinate of a place: then its overtone tells how far the path turns.
    axis_rad : float
        Main axis, from x towards z.
    along, across : ndarray, shape (n,)
        Where the product is along that axis and across it, from the middle of all, in the track's length unit.
    drive : ndarray, shape (n,), or None
        The tool's own position along the main axis, where it moves by more than its noise.
    drive_std : float
        That noise.
    angle_rad, angle_std_rad : ndarray, shape (n,)
        The product's rotation and its standard error; NaN where there is none.
    angle_stated_std, angle_pulled_std : float
        The two parts of its standard error as for the positions.
    """

    time_s: FloatArray
    value: FloatArray
    spread: FloatArray
    stated_std: float
    pulled_std: float
    curvature: float
    curvature_std: float
    planar: bool
    axis_rad: float
    along: FloatArray
    across: FloatArray
    drive: FloatArray | None
    drive_std: float
    angle_rad: FloatArray
    angle_std_rad: FloatArray
    angle_stated_std: float
    angle_pulled_std: float
    common: FloatArray | None = None
    angular: bool = False
    projected: bool = False

    def chord(self, way: FloatArray) -> FloatArray:
        """Return the displacement along the main axis at these ways along the path, counted from equilibrium."""
        if self.curvature == 0 or self.angular:
            return way
        return np.asarray(np.sin(self.curvature * way) / self.curvature, dtype=float)


def check_window(window: Window, time_s: FloatArray) -> None:
    """Raise InputError where a window does not lie inside the record.

    Parameters
    ----------
    window : Window
        As the user gave it.
    time_s : ndarray, shape (n,)
        Times of the record.
    """
    if len(time_s) == 0:
        raise NotIdentifiableError("nothing swings: the record is empty")
    first, last = float(time_s[0]), float(time_s[-1])
    slack = 0.5 * (last - first) / max(len(time_s) - 1, 1) + 1e-9
    if not (window.start_s >= first - slack and window.end_s <= last + slack):
        raise InputError(
            f"the window {window.start_s:g}:{window.end_s:g} s does not lie inside the record, "
            f"which runs from {first:g} to {last:g} s: choose both ends in it"
        )


def measure_sway(track: Track, window: Window | None = None, *, sway_axis: str | None = None, arc: bool = True) -> Sway:
    """Return the sway inside a window.

    Parameters
    ----------
    track : Track
        Raw; what was not seen is NaN and is left out, never filled in.
    window : Window, optional
        By default the whole record.
    sway_axis : str, optional
        "x", "z" or degrees from x towards z; by default the axis of largest scatter.
    arc : bool
        Whether to look for an arc; without, the value is the projection on the axis.

    Returns
    -------
    Sway
        Possibly of few samples, or none.

    Notes
    -----
    The tag runs on an arc. Where both coordinates show one, the signal is the way along the arc: its spectrum has an
    overtone far below that of the projection r sin q, and its amplitude is not compressed at large angles.
    """
    places = _find_places(track, window)
    kept, pcp = places.kept, track.pcp
    if len(kept) == 0:
        return _no_sway(planar=places.planar)
    points = places.points[kept]
    steady = np.all(np.column_stack([remove_spikes(c) for c in points.T]) == points, axis=1)
    centre, axis = _main_axis(points[steady]) if places.planar else (np.median(points, axis=0), 0.0)
    axis = axis if sway_axis is None else _read_axis(sway_axis)
    direction = np.array([np.cos(axis), np.sin(axis)])
    along = (points - centre) @ direction
    across = (points - centre) @ np.array([-direction[1], direction[0]])
    std, image_std, pulled_std = np.hypot(*(places.std * direction).T).T
    planar = places.planar and arc
    value, curvature, curvature_std = _way_along_arc(along, across, steady) if planar else (along, 0.0, 0.0)
    angular = arc and not planar and track.length_unit == "rad"
    drive, drive_std = _find_drive(track, kept, direction)
    return Sway(
        time_s=track.time_s[kept],
        value=value,
        spread=_spread(std[kept]),
        stated_std=find_image_noise(image_std),
        pulled_std=_median(pulled_std[kept]),
        curvature=1.0 if angular else curvature,
        curvature_std=curvature_std,
        planar=planar or angular,
        angular=angular,
        projected=arc and not planar and track.length_unit in ("m", "px"),
        axis_rad=axis,
        along=along,
        across=across,
        drive=drive,
        drive_std=drive_std,
        angle_rad=pcp.angle_rad[kept],
        angle_std_rad=pcp.angle_std_rad[kept],
        angle_stated_std=find_image_noise(pcp.angle_std_rad, share=pcp.image_share),
        angle_pulled_std=_median(np.sqrt(1 - pcp.image_share) * pcp.angle_std_rad[kept]),
    )


def _read_axis(text: str) -> float:
    """Return "x", "z" or degrees from x towards z in rad."""
    return {"x": 0.0, "z": np.pi / 2}[text] if text in ("x", "z") else float(np.radians(float(text)))


def _no_sway(*, planar: bool) -> Sway:
    none = np.empty(0)
    return Sway(
        time_s=none,
        value=none,
        spread=none,
        stated_std=0.0,
        pulled_std=0.0,
        curvature=0.0,
        curvature_std=0.0,
        planar=planar,
        axis_rad=0.0,
        along=none,
        across=none,
        drive=None,
        drive_std=0.0,
        angle_rad=none,
        angle_std_rad=none,
        angle_stated_std=0.0,
        angle_pulled_std=0.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Places:
    """Where the product is from its tool, shape (n, 2), and which samples count.

    `std` of shape (3, n, 2) holds the standard errors in all, the images' part of them, and a coder's.
    """

    points: FloatArray
    std: FloatArray
    kept: IntArray
    planar: bool


def _find_places(track: Track, window: Window | None) -> _Places:
    """Return the product's places; a second coordinate that was not seen is 0 and without error."""
    points, std = _relative(track)
    inside = np.isfinite(track.time_s)
    if window is not None:
        inside &= (track.time_s >= window.start_s - 1e-9) & (track.time_s <= window.end_s + 1e-9)
    seen = np.isfinite(points[inside])
    second = points[inside, 1][seen[:, 1]]
    # A source without a second coordinate may hold zeros in its place.
    planar = bool(len(second) > 0.5 * np.count_nonzero(seen[:, 0]) and np.ptp(second) > 0)
    if not planar:
        points, std = points.copy(), std.copy()
        points[:, 1] = std[:, :, 1] = 0.0
    kept = np.flatnonzero(inside & np.all(np.isfinite(points), axis=1))
    return _Places(points=points, std=std, kept=kept, planar=planar)


def _find_drive(track: Track, kept: IntArray, direction: FloatArray) -> tuple[FloatArray | None, float]:
    """Return how the tool moves along the axis and its noise; None where it rests, creeps evenly or is not seen.

    Without its straight line: what moves evenly pushes nothing, and its noise would pass for a push.
    """
    if track.tcp is None:
        return None, 0.0
    drive = track.tcp.position[kept] @ direction
    if len(drive) < 8 or not np.all(np.isfinite(drive)):
        return None, 0.0
    drive, time = remove_spikes(drive - np.median(drive)), track.time_s[kept]
    drive = drive - np.polynomial.Polynomial.fit(time, drive, 1)(time)
    noise = MAD_TO_STD * float(np.median(np.abs(np.diff(drive, 3)))) / float(np.sqrt(20))
    return (drive, noise) if float(np.std(drive)) > DRIVEN * noise else (None, 0.0)


def remove_spikes(value: FloatArray) -> FloatArray:
    """Replace single outliers by their neighbours' median: for start values and peaks, never before a fit.

    Parameters
    ----------
    value : ndarray, shape (n,)
        Finite.

    Returns
    -------
    ndarray, shape (n,)
    """
    if len(value) < 5:
        return value
    middle = median_filter(value, size=5, mode="nearest")
    away = np.abs(value - middle)
    # Second differences know the noise and how far a smooth peak stands above its neighbours' median.
    limit = 8 * MAD_TO_STD * float(np.median(np.abs(np.diff(value, 2)))) / np.sqrt(6)
    return np.where(away > limit, middle, value)


def _relative(track: Track) -> tuple[FloatArray, FloatArray]:
    """Return positions from the tool, and their standard errors: all, the images' part of them, and a coder's."""
    points, std, tool = track.pcp.position, _errors(track.pcp), track.tcp
    if tool is None or np.count_nonzero(np.isfinite(points[:, 0] - tool.position[:, 0])) < 8:
        return points, std
    return points - tool.position, np.hypot(std, _errors(tool))


def _errors(tag: TagTrack) -> FloatArray:
    """Return the standard errors of a tag's positions, the images' part of them, and a coder's, shape (3, n, 2)."""
    std, share = tag.position_std, tag.image_share
    return np.stack([std, np.sqrt(share) * std, np.sqrt(1 - share) * std])


def _median(std: FloatArray) -> float:
    """Return the median standard error; 0 where none is stated."""
    stated = std[np.isfinite(std)]
    return float(np.median(stated)) if len(stated) else 0.0


def _spread(std: FloatArray) -> FloatArray:
    usable = np.isfinite(std) & (std > 0)
    if np.count_nonzero(usable) < 0.5 * len(std):
        return np.ones(len(std))
    relative = np.where(usable, std, np.nan) / np.median(std[usable])
    # A sample cannot outweigh all others, whatever its tracker says of it.
    return np.clip(np.nan_to_num(relative, nan=1.0), 0.3, 30.0)


def _main_axis(points: FloatArray) -> tuple[FloatArray, float]:
    """Return centre and direction of largest scatter, by Student-t weights so that spikes do not turn it."""
    centre = np.median(points, axis=0)
    weight: FloatArray = np.ones(len(points))
    covariance = np.eye(2)
    for _ in range(20):
        away = points - centre
        covariance = (away * weight[:, None]).T @ away / np.sum(weight)
        trace = float(np.trace(covariance))
        if not trace > 0:
            return centre, 0.0
        inverse = np.linalg.inv(covariance + 1e-9 * trace * np.eye(2))
        weight = 5.0 / (3.0 + np.einsum("ij,jk,ik->i", away, inverse, away))
        centre = weight @ points / np.sum(weight)
    vector = np.linalg.eigh(covariance)[1][:, -1]
    angle = float(np.arctan2(vector[1], vector[0]))
    # An axis has no direction: the one towards +x (or straight up) is taken.
    return centre, (angle + np.pi / 2) % np.pi - np.pi / 2 if abs(vector[0]) > 1e-6 else np.pi / 2


def _way_along_arc(along: FloatArray, across: FloatArray, steady: BoolArray) -> tuple[FloatArray, float, float]:
    """Return way, curvature and its error from the circle a (s² + v²) + b s + v + d = 0, linear in a, b and d."""
    # A spike far out on either axis would turn the circle by its leverage.
    reach = 6 * MAD_TO_STD * float(np.median(np.abs(along)))
    steady = steady & (np.abs(along) <= reach) & (np.abs(across) <= reach)
    size = float(np.max(np.abs(along[steady]), initial=0.0))
    if np.count_nonzero(steady) < 12 or not size > 0:
        return along, 0.0, 0.0
    s, v = along / size, across / size
    columns = np.column_stack([s**2 + v**2, s, np.ones(len(s))])[steady]
    weight: FloatArray = np.ones(len(columns))
    circle: FloatArray = np.zeros(3)
    scale = 0.0
    for _ in range(8):
        circle = np.asarray(np.linalg.lstsq(columns * weight[:, None], -v[steady] * weight, rcond=None)[0], dtype=float)
        residual = np.asarray(v[steady] + columns @ circle, dtype=float)
        scale = MAD_TO_STD * float(np.median(np.abs(residual)))
        if not scale > 1e-12:
            break
        weight = np.where(np.abs(residual) < 6 * scale, (1 + (residual / (1.5 * scale)) ** 2) ** -0.25, 0.0)
    a, b, d = circle
    discriminant = 1 + b**2 - 4 * a * d
    inverse: FloatArray = np.asarray(
        np.linalg.pinv((columns * weight[:, None]).T @ (columns * weight[:, None])), dtype=float
    )
    std = 2 * scale * float(np.sqrt(inverse[0, 0])) / size
    if not discriminant > 0 or not abs(a) / size > 3 * std + 1e-6 / size:
        return along, 0.0, std
    curvature = 2 * a / np.sqrt(discriminant)
    centre_s, centre_v = -b / (2 * a), -1 / (2 * a)
    side = -np.sign(centre_v)
    way = np.arctan2(s - centre_s, side * (v - centre_v)) / abs(curvature)
    return way * size, float(abs(curvature)) / size, std
