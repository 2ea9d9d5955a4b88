"""Where a tag will be: its last poses extrapolated."""

from collections.abc import Sequence

from tagsway.model import FloatArray

Pose = tuple[float, FloatArray]
"""A time in s, and the homography (3, 3) then, its last element 1."""

_FORGET_SHAPE_S = 0.5  # after so long a tag is looked for at its last place, not where it was heading
_FORGET_SPANS = 8  # ... and after so many times what the known poses span


def predict_pose(poses: Sequence[Pose], time_s: float) -> FloatArray:
    """Return the pose at a time, extrapolated through the last ones.

    Parameters
    ----------
    poses : sequence of (time in s, homography of shape (3, 3))
        One to three, of rising times, each homography with last element 1.
    time_s : float
        After the last of them.

    Returns
    -------
    ndarray, shape (3, 3)
        Of the polynomial through them (Lagrange); of a line where the time is farther off than they span, and the last
        one where it is much farther.
    """
    first_s, (last_s, last) = poses[0][0], poses[-1]
    ahead, span = time_s - last_s, last_s - first_s
    if len(poses) == 1 or ahead > _FORGET_SHAPE_S or ahead > _FORGET_SPANS * span:
        return last
    before_s, before = poses[-2]
    if len(poses) == 2 or ahead > span:
        on = ahead / (last_s - before_s)
        return (1 + on) * last - on * before
    first, past, next_s = poses[0][1], time_s - first_s, last_s - before_s
    predicted: FloatArray = (past * (ahead + next_s) / (span * next_s)) * last
    predicted -= (past * ahead / ((before_s - first_s) * next_s)) * before
    predicted += ((ahead + next_s) * ahead / ((before_s - first_s) * span)) * first
    return predicted
