"""The pattern at the image's own pixels: compiled, because it is done for every pixel of a tag in every image."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import types

from tagsway.compiled import compile_part, compile_whole
from tagsway.model import IntArray
from tagsway.tags.template import Float32Array

PLANES = 7
"""Of numbers for each pixel: the pattern's derivatives by x and y of the image, in units of the scale; the pattern; its
weight; the image times that; how far right of and below the tag's centre the pixel lies, in units of the scale."""

_SMALLEST_REGION_PX = 10
_KNOWN_WEIGHT = np.float32(0.999)  # a pixel that a streak brings less of the pattern to is not known
_MIDDLE_GREY = np.float32(128)  # taken off, so that sums of squares keep their digits
_ZERO, _ONE = np.float32(0), np.float32(1)


@compile_part
def _find_region(shape, h, half_width):
    """Return left, top, width and height of the pixels that a square of the tag's frame covers."""
    left, top, right, bottom = math.inf, math.inf, -math.inf, -math.inf
    for u in (-half_width, half_width):
        for v in (-half_width, half_width):
            depth = h[2, 0] * u + h[2, 1] * v + h[2, 2]
            across, down = (h[0, 0] * u + h[0, 1] * v + h[0, 2]) / depth, (h[1, 0] * u + h[1, 1] * v + h[1, 2]) / depth
            left, right = min(left, across), max(right, across)
            top, bottom = min(top, down), max(bottom, down)
    left, top = max(np.floor(left), 0.0), max(np.floor(top), 0.0)
    right, bottom = min(np.ceil(right), shape[1] - 1.0), min(np.ceil(bottom), shape[0] - 1.0)
    width, height = right - left + 1, bottom - top + 1
    if width >= _SMALLEST_REGION_PX and height >= _SMALLEST_REGION_PX:
        return int(left), int(top), int(width), int(height)
    return 0, 0, 0, 0


@compile_part
def _share(h, scale):
    """Return what takes derivatives by the tag's frame to those by the image, in units of the scale, row by row.

    It is the inverse of ∂(pixel)/∂(tag's frame) at the tag's centre.
    """
    x, y = h[0, 2], h[1, 2]
    a, b, c, d = h[0, 0] - x * h[2, 0], h[0, 1] - x * h[2, 1], h[1, 0] - y * h[2, 0], h[1, 1] - y * h[2, 1]
    share = scale / (a * d - b * c)
    return np.float32(share * d), np.float32(-share * c), np.float32(-share * b), np.float32(share * a)


@compile_part
def _find_view(h, half_width, texels, left, top):
    """Return what takes the region's pixels to the texture's (column, row); its y goes up."""
    a, b, c = h[0, 0] - left * h[2, 0], h[0, 1] - left * h[2, 1], h[0, 2] - left * h[2, 2]
    d, e, f = h[1, 0] - top * h[2, 0], h[1, 1] - top * h[2, 1], h[1, 2] - top * h[2, 2]
    g, i, j = h[2, 0], h[2, 1], h[2, 2]
    back = np.array(
        [
            [e * j - f * i, c * i - b * j, b * f - c * e],
            [f * g - d * j, a * j - c * g, c * d - a * f],
            [d * i - e * g, b * g - a * i, a * e - b * d],
        ]
    )
    to_texel, middle = texels / (2 * half_width), (texels - 1) / 2
    view = np.empty((3, 3))
    for k in range(3):
        view[0, k] = to_texel * back[0, k] + middle * back[2, k]
        view[1, k] = -to_texel * back[1, k] + middle * back[2, k]
        view[2, k] = back[2, k]
    return view


@compile_part
def _find_span(view, row, width, last):
    """Return the first and the last pixel of a row that see the texture; the view's depth is negative or positive."""
    low, high = 0.0, width - 1.0
    slope, depth = view[2, 0], view[2, 1] * row + view[2, 2]
    sign = 1.0 if depth + slope * (width - 1) / 2 > 0 else -1.0
    for k in range(2):
        for inside_of in range(2):
            a, b = sign * (view[k, 1] * row + view[k, 2]), sign * view[k, 0]
            if inside_of:
                a, b = sign * last * depth - a, sign * last * slope - b
            if b > 0:
                low = max(low, np.ceil(-a / b))
            elif b < 0:
                high = min(high, np.floor(-a / b))
            elif not a >= 0:
                high = -1.0
    return int(min(low, width)), int(max(high, -1.0))


@compile_part
def _place_row(view, row, first, count, texels, at, right, down):
    """Find each pixel's texel, and how far right of it and below it the pixel lies."""
    a, b, c = np.float32(view[0, 0]), np.float32(view[1, 0]), np.float32(view[2, 0])
    u_first = np.float32(view[0, 0] * first + view[0, 1] * row + view[0, 2])
    v_first = np.float32(view[1, 0] * first + view[1, 1] * row + view[1, 2])
    depth_first = np.float32(view[2, 0] * first + view[2, 1] * row + view[2, 2])
    last = np.float32(texels - 1.001)
    for k in range(count):
        j = np.float32(k)
        near = _ONE / (c * j + depth_first)
        u, v = (a * j + u_first) * near, (b * j + v_first) * near
        u, v = u if u > _ZERO else _ZERO, v if v > _ZERO else _ZERO  # not max: this way it cannot be NaN
        u, v = u if u < last else last, v if v < last else last
        column, line = np.int32(u), np.int32(v)
        at[k] = 4 * (line * texels + column)
        right[k], down[k] = u - np.float32(column), v - np.float32(line)


@compile_part
def _sample_row(texture, stride, at, right, down, count, seen):
    """Interpolate the texture's four channels."""
    four = np.uint64(4)
    for k in range(count):
        here, u, v, to = np.uint64(at[k]), right[k], down[k], np.uint64(4 * k)
        for channel in range(4):
            c = np.uint64(channel)
            a, b = texture[here + c], texture[here + four + c]
            d, e = texture[here + stride + c], texture[here + stride + four + c]
            upper, lower = a + u * (b - a), d + u * (e - d)
            seen[to + c] = upper + v * (lower - upper)


@compile_part
def _sample(seen, stride, h, texture, half_width, region, margin, rows):
    """Sample the texture for all pixels of the region that lie in it, and note where each row's begin."""
    left, top, width, height = region
    down, right = margin
    texels = texture.shape[0]
    flat, line = texture.reshape(-1), np.uint64(4 * texels)
    view = _find_view(h, half_width, texels, left, top)
    at, off_x, off_y = np.empty(width, np.int32), np.empty(width, np.float32), np.empty(width, np.float32)
    for row in range(height):
        low, high = _find_span(view, row, width, texels - 1.0)
        count = max(high - low + 1, 0)
        rows[row, 1] = low if count else 0
        rows[row + 1, 0] = rows[row, 0] + count
        if count:
            _place_row(view, row, low, count, texels, at, off_x, off_y)
            _sample_row(flat, line, at, off_x, off_y, count, seen[(row + down) * stride + 4 * (low + right) :])


@compile_part
def _smear_row(seen, start, stride, count, streak, smeared):
    """Blur a row of the four channels along the tag's motion, four of the streak's weights at a time."""
    lines, taps = streak.shape
    smeared[: 4 * count] = _ZERO
    for line in range(lines):
        for tap in range(0, taps, 4):
            a = streak[line, tap]
            b = streak[line, tap + 1] if tap + 1 < taps else _ZERO
            c = streak[line, tap + 2] if tap + 2 < taps else _ZERO
            d = streak[line, tap + 3] if tap + 3 < taps else _ZERO
            if a == 0 and b == 0 and c == 0 and d == 0:
                continue
            first = seen[start + line * stride + 4 * tap :]
            second, third, fourth = first[4:], first[8:], first[12:]
            for k in range(4 * count):
                smeared[k] += a * first[k] + b * second[k] + c * third[k] + d * fourth[k]
    for k in range(count):
        if not smeared[4 * k + 3] > _KNOWN_WEIGHT:  # what the edge of the known part swept over is not known
            for channel in range(4):
                smeared[4 * k + channel] = _ZERO


@compile_part
def _split_row(seen, count, grey, shares, x_first, y, step, planes, first):
    """Write a row's pixels into the planes; loops that write into more than two are not done sixteen at a time."""
    end = first + count
    by_x, by_y, pattern, weight = planes[0, first:end], planes[1, first:end], planes[2, first:end], planes[3, first:end]
    image, x_plane, y_plane = planes[4, first:end], planes[5, first:end], planes[6, first:end]
    a, b, c, d = shares
    for k in range(count):
        by_x[k] = a * seen[4 * k] + b * seen[4 * k + 1]
        by_y[k] = c * seen[4 * k] + d * seen[4 * k + 1]
    for k in range(count):
        pattern[k] = seen[4 * k + 2]
        weight[k] = seen[4 * k + 3]
    for k in range(count):
        image[k] = weight[k] * (np.float32(grey[k]) - _MIDDLE_GREY)
    for k in range(count):
        x_plane[k] = x_first + np.float32(k) * step
        y_plane[k] = y


def _see(grey, homography, texture, half_width, known_width, scale, streak):
    """Return the planes, where each row's pixels begin, and the region's width: see `load_see`."""
    left, top, width, height = _find_region(grey.shape, homography, known_width)
    down, right = streak.shape[0] // 2, streak.shape[1] // 2
    stride = 4 * (width + 2 * right)
    seen = np.zeros((height + 2 * down) * stride + 12, np.float32)
    rows = np.zeros((height + 1, 2), np.int64)
    _sample(seen, stride, homography, texture, half_width, (left, top, width, height), (down, right), rows)
    planes = np.empty((PLANES, rows[height, 0]), np.float32)
    smeared = np.empty(4 * width, np.float32)
    shares, unit = _share(homography, scale), np.float32(1 / scale)
    for row in range(height):
        first, low = rows[row]
        count = rows[row + 1, 0] - first
        start = row * stride + 4 * low
        if streak.size > 1:
            _smear_row(seen, start, stride, count, streak, smeared)
        part = smeared if streak.size > 1 else seen[start:]
        x, y = np.float32((left + low - homography[0, 2]) / scale), np.float32((top + row - homography[1, 2]) / scale)
        _split_row(part, count, grey[top + row, left + low :], shares, x, y, unit, planes, first)
    return planes, rows, width


@cache
def load_see() -> Callable[..., tuple[Float32Array, IntArray, int]]:
    """Return the compiled function that finds the planes of all pixels that see a tag's pattern.

    Returns
    -------
    callable
        Takes grey (uint8, (height, width)), homography (float, (3, 3), last element 1), texture (float32, (m, m, 4)),
        its half width, how far of it is to be seen, the scale in px and the streak (float32); see `Template`. Returns
        the planes (float32, (7, pixels): see `PLANES`), where each of the region's rows begins in them and at which of
        its columns (int, (rows + 1, 2)), and the region's width.
    """
    double, single = types.float64, types.float32
    grey = types.Array(types.uint8, 2, "A", readonly=True)
    homography = types.Array(double, 2, "A", readonly=True)
    texture, streak = types.Array(single, 3, "C", readonly=True), types.Array(single, 2, "C", readonly=True)
    return compile_whole(_see, (grey, homography, texture, double, double, double, streak), without_lock=True)
