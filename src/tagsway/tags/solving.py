"""The least-squares step from the planes of `tagsway.tags.seeing`: compiled, because its sums are over every pixel."""

import math

import numpy as np

from tagsway.compiled import compile_part
from tagsway.tags.template import PARAMETERS

SUMMARY = 20
BLOCKS = 10  # to a side

_LONGEST_STEP = 0.1  # of the tag's half side; a longer one was no refinement
_ROUNDING = 1 / 12  # variance of the rounding to grey levels: no image is better
_CHUNK = 1024  # pixels whose numbers stay in the processor's nearest memory
_ZERO = np.float32(0)
_GAIN, _OFFSET = 2, 3  # places in the solution
_IMAGE, _X, _Y = 4, 5, 6  # planes

# The solution's columns and the image, each a sum of terms: sign, plane, power of x, power of y.
_TERMS = np.array(
    [
        [[1, 0, 0, 0], [0, 0, 0, 0]],
        [[1, 1, 0, 0], [0, 0, 0, 0]],
        [[1, 2, 0, 0], [0, 0, 0, 0]],
        [[1, 3, 0, 0], [0, 0, 0, 0]],
        [[1, 0, 1, 0], [0, 0, 0, 0]],
        [[1, 0, 0, 1], [0, 0, 0, 0]],
        [[1, 1, 1, 0], [0, 0, 0, 0]],
        [[1, 1, 0, 1], [0, 0, 0, 0]],
        [[-1, 0, 2, 0], [-1, 1, 1, 1]],
        [[-1, 0, 1, 1], [-1, 1, 0, 2]],
        [[1, 4, 0, 0], [0, 0, 0, 0]],
    ]
)
_PAIRS = np.array([[0, 1, 2, 3, 4], [1, 5, 6, 7, 8], [2, 6, 9, 10, 11], [3, 7, 10, 12, 13], [4, 8, 11, 13, 14]])
_MONOMIALS = 15  # of x and y, up to the fourth power: 1, x, y, x², xy, y², x³ ...


@compile_part
def _sum_powers(a, b, x, y, sums):
    """Add the sums of the planes' product times the powers of x and y up to the second."""
    s = sx = sy = sxx = sxy = syy = _ZERO
    for k in range(len(a)):
        p, u, v = a[k] * b[k], x[k], y[k]
        pu, pv = p * u, p * v
        s, sx, sy = s + p, sx + pu, sy + pv
        sxx, sxy, syy = sxx + pu * u, sxy + pu * v, syy + pv * v
    sums[0], sums[1], sums[2] = sums[0] + s, sums[1] + sx, sums[2] + sy
    sums[3], sums[4], sums[5] = sums[3] + sxx, sums[4] + sxy, sums[5] + syy


@compile_part
def _sum_high_powers(a, b, x, y, sums):
    """Add the sums of the planes' product times the third and fourth powers of x and y."""
    sxxx = sxxy = sxyy = syyy = sxxxx = sxxxy = sxxyy = sxyyy = syyyy = _ZERO
    for k in range(len(a)):
        p, u, v = a[k] * b[k], x[k], y[k]
        pxx, pyy = p * u * u, p * v * v
        pxxx, pxxy, pxyy, pyyy = pxx * u, pxx * v, pyy * u, pyy * v
        sxxx, sxxy, sxyy, syyy = sxxx + pxxx, sxxy + pxxy, sxyy + pxyy, syyy + pyyy
        sxxxx, sxxxy, sxxyy = sxxxx + pxxx * u, sxxxy + pxxx * v, sxxyy + pxxy * v
        sxyyy, syyyy = sxyyy + pxyy * v, syyyy + pyyy * v
    sums[6], sums[7], sums[8], sums[9] = sums[6] + sxxx, sums[7] + sxxy, sums[8] + sxyy, sums[9] + syyy
    sums[10], sums[11], sums[12] = sums[10] + sxxxx, sums[11] + sxxxy, sums[12] + sxxyy
    sums[13], sums[14] = sums[13] + sxyyy, sums[14] + syyyy


@compile_part
def _sum_plain(a, b, c, sums):
    """Add the sums of all products of three planes."""
    aa = ab = ac = bb = bc = cc = _ZERO
    for k in range(len(a)):
        u, v, w = a[k], b[k], c[k]
        aa, ab, ac = aa + u * u, ab + u * v, ac + u * w
        bb, bc, cc = bb + v * v, bc + v * w, cc + w * w
    sums[9, 0], sums[10, 0], sums[11, 0] = sums[9, 0] + aa, sums[10, 0] + ab, sums[11, 0] + ac
    sums[12, 0], sums[13, 0], sums[14, 0] = sums[12, 0] + bb, sums[13, 0] + bc, sums[14, 0] + cc


@compile_part
def _multiply(planes):
    """Return the scalar products of the solution's columns and the image, shape (11, 11).

    The columns of J are the pattern's derivatives times powers of x and y, so all of JᵀJ and JᵀI are moments of nine
    products of planes: no column is ever formed.
    """
    sums = np.zeros((15, _MONOMIALS))
    count = planes.shape[1]
    for start in range(0, count, _CHUNK):
        end = min(start + _CHUNK, count)
        x, y = planes[_X, start:end], planes[_Y, start:end]
        for one in range(2):
            for other in range(one, 5):
                a, b, into = planes[one, start:end], planes[other, start:end], sums[_PAIRS[one, other]]
                _sum_powers(a, b, x, y, into)
                if other < 2:
                    _sum_high_powers(a, b, x, y, into)
        _sum_plain(planes[2, start:end], planes[3, start:end], planes[4, start:end], sums)
    products = np.zeros((PARAMETERS + 1, PARAMETERS + 1))
    for one in range(PARAMETERS + 1):
        for other in range(PARAMETERS + 1):
            for k in range(2):
                for m in range(2):
                    sign = _TERMS[one, k, 0] * _TERMS[other, m, 0]
                    lines = _TERMS[one, k, 3] + _TERMS[other, m, 3]
                    power = _TERMS[one, k, 2] + _TERMS[other, m, 2] + lines
                    pair = _PAIRS[_TERMS[one, k, 1], _TERMS[other, m, 1]]
                    products[one, other] += sign * sums[pair, power * (power + 1) // 2 + lines]
    return products


@compile_part
def _invert(matrix):
    """Return the inverse of a positive definite matrix, by Gauss and Jordan; NaN where it is none."""
    size = len(matrix)
    inverse = matrix.copy()
    for k in range(size):
        pivot = inverse[k, k]
        if not pivot > 0:
            inverse[:] = math.nan
            return inverse
        for i in range(size):
            if i != k:
                factor = inverse[i, k] / pivot
                for j in range(size):
                    inverse[i, j] -= factor * inverse[k, j]
                inverse[i, k] = -factor
        for j in range(size):
            inverse[k, j] /= pivot
        inverse[k, k] = 1 / pivot
    return inverse


@compile_part
def _dot(a, b):
    """Return the product of two matrices."""
    product = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                product[i, j] += a[i, k] * b[k, j]
    return product


@compile_part
def _move_back(h, step, scale, moved):
    """Write V⁻¹ H to third order in the step, V given about the tag's centre in units of the scale."""
    x, y = h[0, 2], h[1, 2]
    dx, dy, xx, xy = step[0], step[1], step[2], step[3]
    yx, yy, p, q = step[4], step[5], step[6] / scale, step[7] / scale
    t = -p * x - q * y
    move = np.empty((3, 3))
    move[0, 0], move[0, 1], move[0, 2] = xx + x * p, xy + x * q, scale * dx - xx * x - xy * y + x * t
    move[1, 0], move[1, 1], move[1, 2] = yx + y * p, yy + y * q, scale * dy - yx * x - yy * y + y * t
    move[2, 0], move[2, 1], move[2, 2] = p, q, t
    once = _dot(move, h)
    twice = _dot(move, once)
    depth = h[2, 2] - once[2, 2] + twice[2, 2]
    for i in range(3):
        for j in range(3):
            moved[3 * i + j] = (h[i, j] - once[i, j] + twice[i, j]) / depth


@compile_part
def _combine(planes, weights, values):
    """Write a linear function of the solution's columns, pixel by pixel."""
    by_x, by_y, pattern, weight, x, y = planes[0], planes[1], planes[2], planes[3], planes[_X], planes[_Y]
    c, d, p, w = np.float32(weights[0]), np.float32(weights[1]), np.float32(weights[2]), np.float32(weights[3])
    cx, cy, dx, dy = np.float32(weights[4]), np.float32(weights[5]), np.float32(weights[6]), np.float32(weights[7])
    qx, qy = np.float32(weights[8]), np.float32(weights[9])
    for k in range(len(values)):
        inward = qx * x[k] + qy * y[k]
        across = (c + (cx - inward) * x[k] + cy * y[k]) * by_x[k]
        along = (d + dx * x[k] + (dy - inward) * y[k]) * by_y[k]
        values[k] = across + along + p * pattern[k] + w * weight[k]


@compile_part
def _sum_blocks(planes, rows, width, solution, influence, variances):
    """Write the variances of three sums, from their parts over blocks of the image."""
    height, count = len(rows) - 1, planes.shape[1]
    seen, part, image = np.empty(count, np.float32), np.empty(count, np.float32), planes[_IMAGE]
    _combine(planes, solution, seen)
    across = np.empty(width, np.int64)
    for column in range(width):
        across[column] = ((column + 1) * BLOCKS - 1) // width
    for k in range(3):
        _combine(planes, influence[k], part)
        blocks = np.zeros((BLOCKS, BLOCKS))
        for row in range(height):
            line, off = ((row + 1) * BLOCKS - 1) // height, rows[row, 1] - rows[row, 0]
            for pixel in range(rows[row, 0], rows[row + 1, 0]):
                blocks[line, across[pixel + off]] += part[pixel] * (image[pixel] - seen[pixel])
        variances[k] = 0.0
        for line in range(BLOCKS):
            for column in range(BLOCKS):
                variances[k] += blocks[line, column] ** 2 * (BLOCKS**2 / (BLOCKS**2 - PARAMETERS))


@compile_part
def _find_wanted(h, scale):
    """Return centre x, centre y and angle as linear functions of the solution, shape (10, 3); signs left out."""
    dx, dy = h[0, 0] - h[0, 2] * h[2, 0], h[1, 0] - h[1, 2] * h[2, 0]
    square = dx * dx + dy * dy
    wanted = np.zeros((PARAMETERS, 3))
    wanted[0, 0] = wanted[1, 1] = scale
    wanted[4, 2], wanted[5, 2] = -dx * dy / square, -dy * dy / square
    wanted[6, 2], wanted[7, 2] = dx * dx / square, dx * dy / square
    return wanted


@compile_part
def solve(planes, rows, width, h, scale, with_blocks):
    """Return the summary of a Gauss-Newton step.

    Parameters
    ----------
    planes, rows, width
        What `tagsway.tags.seeing.see` returns.
    h : ndarray, shape (3, 3)
        The homography; its last element is 1.
    scale : float
        Pixels to a unit of the tag's frame.
    with_blocks : bool
        Whether the sandwich is wanted.

    Returns
    -------
    ndarray, shape (20,)
        The new homography (9); for white noise the variances of centre x, y and angle and the covariance of x and y;
        their sandwich (3); the residual's variance, the gain, the step in px and the correlation. The first is NaN
        where the step is none.
    """
    summary = np.empty(SUMMARY)
    summary[:] = math.nan
    products = _multiply(planes)
    normal, sums, squares = products[:-1, :-1], products[:-1, -1:], products[-1, -1]
    count = normal[_OFFSET, _OFFSET]
    inverse = _invert(normal)
    solution = _dot(inverse, sums)[:, 0]
    fitted = 0.0
    for k in range(PARAMETERS):
        fitted += solution[k] * sums[k, 0]
    gain, mean = solution[_GAIN], normal[_GAIN, _OFFSET] / count
    spread = (squares - sums[_OFFSET, 0] ** 2 / count) * (normal[_GAIN, _GAIN] - mean**2 * count)
    if not (count > PARAMETERS and gain > 0 and spread > 0):
        return summary
    step, longest = np.empty(PARAMETERS - 2), 0.0
    for k in range(PARAMETERS - 2):
        step[k] = solution[k if k < _GAIN else k + 2] / gain
        longest = max(longest, abs(step[k]))
    wanted = _find_wanted(h, scale)
    influence = _dot(wanted.T, inverse)
    covariance = _dot(influence, wanted)
    if not (covariance[0, 0] > 0 and covariance[1, 1] > 0 and covariance[2, 2] > 0 and longest < _LONGEST_STEP):
        return summary
    variance = max((squares - fitted) / (count - PARAMETERS), _ROUNDING)
    _move_back(h, step, scale, summary)
    unit = variance / gain**2
    summary[9], summary[10], summary[11] = unit * covariance[0, 0], unit * covariance[1, 1], unit * covariance[2, 2]
    summary[12] = unit * covariance[0, 1]
    if with_blocks:
        _sum_blocks(planes, rows, width, solution, influence, summary[13:16])
        for k in range(13, 16):
            summary[k] /= gain**2
    summary[16], summary[17], summary[18] = variance, gain, scale * longest
    summary[19] = (sums[_GAIN, 0] - sums[_OFFSET, 0] * mean) / math.sqrt(spread)
    return summary
