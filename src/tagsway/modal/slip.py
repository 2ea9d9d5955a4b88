"""A grip that slips: the product's distance from the pivot grows while it is held."""

from dataclasses import dataclass

import numpy as np

from tagsway.modal.sway import MAD_TO_STD
from tagsway.model import Estimate, FloatArray

LEAST_GROWTH = 0.03
"""Share of the radius: a sway of 0.3 rad out of the plane, or a change of the tag's scale, feigns 0.02."""

LEAST_STD = 5.0
"""Growth over the scatter of the distances that remains."""

MOST_SAMPLES = 800
"""That are looked at."""

FEWEST = 40
"""Samples, below which nothing is said."""

TRIED = 60
"""Instants."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """When a grip slipped, and by how much, in the unit of the track."""

    time_s: Estimate
    growth: Estimate


def find_slip(time_s: FloatArray, relative: FloatArray, tool: FloatArray) -> Slip | None:
    """Find a lasting growth of the radius on which a product swings.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Of the sightings.
    relative : ndarray, shape (n, 2)
        Product minus tool, without spikes.
    tool : ndarray, shape (n, 2)
        Where the tool was.

    Returns
    -------
    Slip or None

    Notes
    -----
    For a circle around c, |p|² = 2 p·c + k with k = r² - |c|². A step in k at an unknown instant is a slip; everything
    else is linear. A difference of scale ε between the tags adds 2 ε p·X where the tool is at X: it is fitted too.
    """
    step = max(1, len(time_s) // MOST_SAMPLES)
    time, points = time_s[::step], relative[::step]
    if len(time) < FEWEST:
        return None
    rows = [2 * points, np.ones((len(time), 1))]
    if float(np.ptp(tool)) > float(np.ptp(points)):
        rows.append(np.sum(points * (tool[::step] - tool[0]), axis=1)[:, None])
    base = np.hstack(rows)
    square = np.sum(points**2, axis=1)
    tried = np.unique(np.quantile(time, np.linspace(0.08, 0.92, TRIED)))
    steps = (time[:, None] > tried).astype(float)
    weight = np.ones(len(time))
    best, answer = 0, np.zeros(base.shape[1] + 1)
    for _ in range(5):
        best = _best_step(base, steps, square, weight)
        columns = np.column_stack([base, steps[:, best]])
        answer = np.linalg.lstsq(columns * weight[:, None], square * weight, rcond=None)[0]
        residual = np.abs(square - columns @ answer)
        scale = MAD_TO_STD * float(np.median(residual))
        weight = 1 / np.sqrt(1 + (residual / max(2 * scale, 1e-300)) ** 2)
    radius = float(np.median(np.hypot(*(points - answer[:2]).T)))
    growth, scatter = float(answer[-1]) / (2 * radius), scale / (2 * radius)
    if not (growth > LEAST_GROWTH * radius and growth > LEAST_STD * scatter):
        return None
    nearest = float(np.max(np.diff(tried), initial=0.0))
    return Slip(time_s=Estimate.normal(float(tried[best]), nearest / 2), growth=Estimate.normal(growth, scatter))


def _best_step(base: FloatArray, steps: FloatArray, square: FloatArray, weight: FloatArray) -> int:
    """Return the step that explains most of what the columns leave."""
    basis = np.linalg.qr(base * weight[:, None])[0]
    left = square * weight - basis @ (basis.T @ (square * weight))
    outside = steps * weight[:, None]
    outside = outside - basis @ (basis.T @ outside)
    return int(np.argmax((outside.T @ left) ** 2 / np.maximum(np.sum(outside**2, axis=0), 1e-300)))
