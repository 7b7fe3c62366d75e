"""Signals side by side -> filtered signals and their largest peaks, as compiled code.

It does what `scipy.signal.sosfiltfilt` and `find_peaks` do, `lanes.WIDTH` signals in the lanes of
the processor's vector units, so that the state of the filter stays in registers.
"""

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.lanes import align_stack, lane_array, number_array

SECTIONS = 4
"""Number of second-order sections: those of a band-pass filter of fourth order."""


@long_running
def filter_both_ways(signals, shape, sections, settled, padding, work, answer):
    """Filter signals forwards and backwards, mirrored at both ends, without phase shift.

    A sample passes through second-order sections in the direct form II transposed:

        y = b0 x + z0;   z0 = b1 x - a1 y + z1;   z1 = b2 x - a2 y

    Args:
        signals: Samples as a flat array of lanes, group after group of `lanes.WIDTH` signals.
        shape: Number of rows of each group, and of groups to filter.
        sections: b0, b1, b2, 1, a1, a2 of each of the `SECTIONS` sections, as from
            `scipy.signal.butter`, flat.
        settled: z0 and z1 of a constant signal of 1 of each section, from
            `scipy.signal.sosfilt_zi`, flat.
        padding: Number of rows by which the signals are mirrored at both ends.
        work: Flat array of (rows + 2 padding) lanes, overwritten.
        answer: The filtered signals, a flat array of lanes as `signals`, written.
    """
    align_stack()
    rows, groups = shape
    given, kept, filtered = lane_array(signals), lane_array(work), lane_array(answer)
    c, rest = number_array(sections), number_array(settled)
    padded = rows + 2 * padding
    for first in range(0, groups * rows, rows):
        state = settled_state(rest, given[first + _mirrored(-padding, rows)])
        for at in range(padded):
            row = _mirrored(at - padding, rows)
            kept[at], state = pass_sections(given[first + row], state, c)
        state = settled_state(rest, kept[padded - 1])
        for at in range(padded - 1, padding - 1, -1):
            value, state = pass_sections(kept[at], state, c)
            if at < padding + rows:
                filtered[first + at - padding] = value


@law
def _mirrored(row, rows):
    """Return a row of a table, mirrored at the first row and at the last one."""
    row = abs(row)
    return min(row, 2 * (rows - 1) - row)


@law
def settled_state(settled, value):
    """Return the state z0, z1 of each section at a constant signal. See `filter_both_ways`."""
    return (
        settled[0] * value,
        settled[1] * value,
        settled[2] * value,
        settled[3] * value,
        settled[4] * value,
        settled[5] * value,
        settled[6] * value,
        settled[7] * value,
    )


@law
def pass_sections(x, z, c):
    """Return the filtered sample of each signal, and the new state. See `filter_both_ways`."""
    x, z0, z1 = pass_section(x, z[0], z[1], c, 0)
    x, z2, z3 = pass_section(x, z[2], z[3], c, 6)
    x, z4, z5 = pass_section(x, z[4], z[5], c, 12)
    x, z6, z7 = pass_section(x, z[6], z[7], c, 18)
    return x, (z0, z1, z2, z3, z4, z5, z6, z7)


@law
def pass_section(x, first, second, c, at):
    """Return the sample behind one section, and its new state. See `filter_both_ways`."""
    y = c[at] * x + first
    return y, c[at + 1] * x - c[at + 4] * y + second, c[at + 2] * x - c[at + 5] * y


@long_running
def largest_peaks(signals, sizes, samples):
    """Find the largest absolute value of each signal at a local maximum or minimum.

    A flat top counts with its middle. A signal without a maximum or without a minimum has its
    largest absolute value of all.

    Args:
        signals: (n, k)
        sizes: (k,) written; NaN for a signal that starts with NaN or has no sample.
        samples: (k,) written: the samples at which they occur; 0 with NaN.
    """
    rows, columns = signals.shape
    for k in range(columns):
        samples[k] = 0
        sizes[k] = -1.0 if rows and signals[0, k] == signals[0, k] else np.nan
    sides = np.zeros((2, columns))
    for row in range(1, rows - 1):
        for k in range(columns):
            size = abs(signals[row, k])
            if size > sizes[k] or sides[0, k] + sides[1, k] < 2.0:
                side = 1.0 if signals[row, k] > signals[row - 1, k] else -1.0
                end = _end_of_peak(signals, row, k, side)
                if end:
                    sides[0 if side > 0.0 else 1, k] = 1.0
                    if size > sizes[k]:
                        sizes[k] = size
                        samples[k] = (row + end - 1) // 2
    _largest_of_all(signals, sides, sizes, samples)


@long_running
def _largest_of_all(signals, sides, sizes, samples):
    """Find the largest absolute value of each signal without a maximum or without a minimum.

    Args:
        signals: (n, k)
        sides: (2, k) 1 if the signal has a maximum, and a minimum.
        sizes, samples: As of `largest_peaks`.
    """
    for k in range(len(sizes)):
        if sizes[k] == sizes[k] and sides[0, k] + sides[1, k] < 2.0:
            for row in range(len(signals)):
                if abs(signals[row, k]) > sizes[k]:
                    sizes[k] = abs(signals[row, k])
                    samples[k] = row


@long_running
def _end_of_peak(signals, row, k, side):
    """Return the first row behind a peak that begins at a row; 0 if there is none.

    Args:
        signals: (n, k)
        row: Row, > 0.
        k: Column.
        side: 1 for a maximum, -1 for a minimum.
    """
    value = signals[row, k]
    if not side * value > side * signals[row - 1, k]:
        return 0
    end = row + 1
    while end < len(signals) - 1 and signals[end, k] == value:
        end += 1
    return end if side * signals[end, k] < side * value else 0
