"""The pattern at the image's own pixels: compiled, because it is done for every pixel of a tag in every image."""

import math

import numpy as np

from tagsway.compiled import compile_part

PLANES = 7
"""Of numbers for each pixel: the pattern's derivatives by x and y of the image, in units of the scale; the pattern; its
weight; the image times that; how far right of and below the tag's centre the pixel lies, in units of the scale."""

_SMALLEST_REGION_PX = 10
_MIDDLE_GREY = np.float32(128)  # taken off, so that sums of squares keep their digits
_ROWS_AT_ONCE = 8  # that are smeared
_ZERO, _HALF, _ONE = np.float32(0), np.float32(0.5), np.float32(1)


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
def _share(h, scale, texels_to_unit):
    """Return what takes derivatives by column and row of the texture to those by the image, in units of the scale.

    It is the inverse of ∂(pixel)/∂(tag's frame) at the tag's centre, row by row; a texture's rows go down.
    """
    x, y = h[0, 2], h[1, 2]
    a, b, c, d = h[0, 0] - x * h[2, 0], h[0, 1] - x * h[2, 1], h[1, 0] - y * h[2, 0], h[1, 1] - y * h[2, 1]
    share = scale * texels_to_unit / (a * d - b * c)
    return np.float32(share * d), np.float32(share * c), np.float32(-share * b), np.float32(-share * a)


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
    last = np.float32(texels - 1.501)
    for k in range(count):
        j = np.float32(k)
        near = _ONE / (c * j + depth_first)
        u, v = (a * j + u_first) * near, (b * j + v_first) * near
        u, v = u if u > _HALF else _HALF, v if v > _HALF else _HALF  # not max: this way it cannot be NaN
        u, v = u if u < last else last, v if v < last else last
        column, line = np.int32(u + _HALF), np.int32(v + _HALF)
        at[k] = line * texels + column
        right[k], down[k] = u - np.float32(column), v - np.float32(line)


@compile_part
def _interpolate_row(texture, stride, at, right, down, by_column, by_row, pattern):
    """Interpolate the pattern by the parabolas through the nearest 3 x 3 texels, and take their derivatives."""
    one = np.uint64(1)
    for k in range(len(pattern)):
        here, u, v = np.uint64(at[k]), right[k], down[k]
        above, below = here - stride, here + stride
        a, b, c = texture[above - one], texture[above], texture[above + one]
        d, e, f = texture[here - one], texture[here], texture[here + one]
        g, h, i = texture[below - one], texture[below], texture[below + one]
        bend_1, bend_2, bend_3 = a - b + (c - b), d - e + (f - e), g - h + (i - h)
        slope_1, slope_2, slope_3 = _HALF * (c - a), _HALF * (f - d), _HALF * (i - g)
        half = _HALF * u
        upper = b + u * (slope_1 + half * bend_1)
        middle = e + u * (slope_2 + half * bend_2)
        lower = h + u * (slope_3 + half * bend_3)
        upper_slope, middle_slope, lower_slope = slope_1 + u * bend_1, slope_2 + u * bend_2, slope_3 + u * bend_3
        slope, bend = _HALF * (lower - upper), upper - middle + (lower - middle)
        pattern[k] = middle + v * (slope + _HALF * v * bend)
        by_row[k] = slope + v * bend
        turn = upper_slope - middle_slope + (lower_slope - middle_slope)
        by_column[k] = middle_slope + v * _HALF * (lower_slope - upper_slope + v * turn)


@compile_part
def _weigh_row(printed, stride, at, right, down, by_column, by_row, pattern, weight):
    """Interpolate what is printed, linearly, and weigh the others by it."""
    one = np.uint64(1)
    for k in range(len(weight)):
        here, u, v = np.uint64(at[k]), right[k], down[k]
        if u < _ZERO:
            here, u = here - one, u + _ONE
        if v < _ZERO:
            here, v = here - stride, v + _ONE
        a, b, c, d = printed[here], printed[here + one], printed[here + stride], printed[here + stride + one]
        upper, lower = a + u * (b - a), c + u * (d - c)
        weight[k] = upper + v * (lower - upper)
    for k in range(len(weight)):
        pattern[k] *= weight[k]
        by_column[k] *= weight[k]
        by_row[k] *= weight[k]


@compile_part
def _smear(seen, row, streak, smeared):
    """Blur rows of one channel along the tag's motion, end to end as if they were one: long loops are quick ones.

    Four of the streak's weights at a time. What runs over a row's end is margin.
    """
    lines, taps = streak.shape
    count, width = smeared.size, smeared.shape[1]
    channel, into = seen.reshape(-1), smeared.reshape(-1)
    into[:] = _ZERO
    for line in range(lines):
        tap = 0
        while tap < taps:
            a = streak[line, tap]
            if a == 0:
                tap += 1
                continue
            b = streak[line, tap + 1] if tap + 1 < taps else _ZERO
            c = streak[line, tap + 2] if tap + 2 < taps else _ZERO
            d = streak[line, tap + 3] if tap + 3 < taps else _ZERO
            one = channel[(row + line) * width + tap :]
            two, three, four = one[1:], one[2:], one[3:]
            for k in range(count):
                into[k] += a * one[k] + b * two[k] + c * three[k] + d * four[k]
            tap += 4


@compile_part
def _find_known(spans, row, streak, least):
    """Return the first and the last pixel of a row for which all that weights above the least sweep over is known."""
    lines, taps = streak.shape
    low, high = spans[row + lines // 2]
    for line in range(lines):
        for tap in range(taps):
            if streak[line, tap] != 0 and streak[line, tap] > least:
                low = max(low, spans[row + line, 0] + taps // 2 - tap)
                high = min(high, spans[row + line, 1] + taps // 2 - tap)
    return low, high


@compile_part
def _weigh_ends(spans, row, streak, low, weight):
    """Sum the weights over what is known, where that is not all: the negative ones at a streak's ends may miss it."""
    lines, taps = streak.shape
    count = len(weight)
    first, last = _find_known(spans, row, streak, -math.inf)
    first = min(max(first - low, 0), count)
    after = max(min(last - low + 1, count), first)
    for start, end in ((0, first), (after, count)):
        for k in range(start, end):
            weight[k] = _ZERO
            for line in range(lines):
                for tap in range(taps):
                    if spans[row + line, 0] <= low + k + tap - taps // 2 <= spans[row + line, 1]:
                        weight[k] += streak[line, tap]


@compile_part
def _finish_row(planes, first, end, shares, grey, x_first, y, step):
    """Turn a row's derivatives into the image's, and add the image and each pixel's place.

    Loops that write into more than two planes are not done sixteen at a time.
    """
    by_x, by_y, weight, image = planes[0, first:end], planes[1, first:end], planes[3, first:end], planes[4, first:end]
    x_plane, y_plane = planes[5, first:end], planes[6, first:end]
    a, b, c, d = shares
    for k in range(end - first):
        by_column, by_row = by_x[k], by_y[k]
        by_x[k] = a * by_column + b * by_row
        by_y[k] = c * by_column + d * by_row
    for k in range(end - first):
        image[k] = weight[k] * (np.float32(grey[k]) - _MIDDLE_GREY)
    for k in range(end - first):
        x_plane[k] = x_first + np.float32(k) * step
        y_plane[k] = y


@compile_part
def see(grey, homography, texture, printed, half_width, known_width, scale, streak):
    """Return the planes of all pixels that see a tag's pattern.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to it; its last element is 1.
    texture, printed, half_width, known_width
        Pattern and what is printed, float32, their half width, and how far of it is to be seen: see `Template`.
    scale : float
        Pixels to a unit of the tag's frame.
    streak : ndarray of float32
        What the motion draws: see `find_streak`.

    Returns
    -------
    planes : ndarray of float32, shape (7, pixels)
        See `PLANES`.
    rows : ndarray of int, shape (rows + 1, 2)
        Where each of the region's rows begins in them, and at which of its columns.
    width : int
        Of the region.
    """
    left, top, width, height = _find_region(grey.shape, homography, known_width)
    texels, still, is_full = texture.shape[0], streak.size == 1, printed.size == 0
    down, right = streak.shape[0] // 2, streak.shape[1] // 2
    view = _find_view(homography, half_width, texels, left, top)
    spans = np.empty((height + 2 * down, 2), np.int64)
    for row in range(len(spans)):
        spans[row] = width, -1
        if down <= row < height + down:
            spans[row] = _find_span(view, row - down, width, texels - 1.0)
    rows = np.zeros((height + 1, 2), np.int64)
    for row in range(height):
        low, high = _find_known(spans, row, streak, 0.0)
        rows[row, 1] = low if high >= low else 0
        rows[row + 1, 0] = rows[row, 0] + max(high - low + 1, 0)
    planes = np.empty((PLANES, rows[height, 0]), np.float32)
    channels = 3 if is_full else 4
    # What a streak sweeps over: the whole region, with a margin of nothing.
    seen = np.zeros((channels, 0 if still else height + 2 * down + 1, width + 2 * right), np.float32)
    at, off_x, off_y = np.empty(width, np.int32), np.empty(width, np.float32), np.empty(width, np.float32)
    flat, flat_printed, stride = texture.reshape(-1), printed.reshape(-1), np.uint64(texels)
    for row in range(height):
        low, high = spans[row + down]
        count = max(high - low + 1, 0)
        start = rows[row, 0] if still else low + right
        into = (planes if still else seen[:, row + down])[:, start : start + count]
        _place_row(view, row, low, count, texels, at, off_x, off_y)
        _interpolate_row(flat, stride, at, off_x, off_y, into[0], into[1], into[2])
        if not is_full:
            _weigh_row(flat_printed, stride, at, off_x, off_y, into[0], into[1], into[2], into[3])
    if is_full:
        planes[3] = _ONE
    smeared = np.empty((channels, _ROWS_AT_ONCE, width + 2 * right), np.float32)
    shares, unit = _share(homography, scale, texels / (2 * half_width)), np.float32(1 / scale)
    for row in range(height):
        (start, low), end = rows[row], rows[row + 1, 0]
        if is_full and not still:
            _weigh_ends(spans, row, streak, low, planes[3, start:end])
        for channel in range(0 if still else channels):
            if row % _ROWS_AT_ONCE == 0:
                rest = min(height - row, _ROWS_AT_ONCE)
                _smear(seen[channel], row, streak, smeared[channel, :rest])
            planes[channel, start:end] = smeared[channel, row % _ROWS_AT_ONCE, low : low + end - start]
        x, y = np.float32((left + low - homography[0, 2]) / scale), np.float32((top + row - homography[1, 2]) / scale)
        _finish_row(planes, start, end, shares, grey[top + row, left + low :], x, y, unit)
    return planes, rows, width
