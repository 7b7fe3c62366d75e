"""Signals side by side -> filtered signals and their largest peaks, as compiled code.

It does what `scipy.signal.sosfiltfilt` and `find_peaks` do, one row of samples after the other, so
that the signals of all runs of a batch are in one SIMD register: five times as fast.
"""

import numpy as np

from wm_drake.compiler.compilation import long_running


@long_running
def filter_both_ways(signals, shape, sections, settled, padding, work, answer):
    """Filter signals forwards and backwards, mirrored at both ends, without phase shift.

    A sample passes through second-order sections in the direct form II transposed:

        y = b0 x + z0;   z0 = b1 x - a1 y + z1;   z1 = b2 x - a2 y

    Args:
        signals: Samples, row after row, flat.
        shape: Number of rows, of columns to filter, and of columns of `signals`.
        sections: (s, 6) b0, b1, b2, 1, a1, a2 of each section, as from `scipy.signal.butter`.
        settled: (s, 2) z0 and z1 of a constant signal of 1, from `scipy.signal.sosfilt_zi`.
        padding: Number of rows by which the signals are mirrored at both ends.
        work: (rows + 2 padding, columns), overwritten.
        answer: (rows, columns), written.
    """
    rows, columns, stride = shape
    value = np.empty(columns)
    state = np.empty((2 * len(sections), columns))
    padded = rows + 2 * padding
    for at in range(padded):
        row = abs(at - padding)  # mirrored at the first row
        row = min(row, 2 * (rows - 1) - row)  # and at the last one
        for k in range(columns):
            value[k] = signals[row * stride + k]
        if at == 0:
            _settle(state, settled, value)
        _pass_sections(value, state, sections)
        work[at] = value
    value[:] = work[padded - 1]
    _settle(state, settled, value)
    for at in range(padded - 1, padding - 1, -1):
        value[:] = work[at]
        _pass_sections(value, state, sections)
        if at < padding + rows:
            answer[at - padding] = value


@long_running
def _settle(state, settled, value):
    """Set the state of each section to that of a constant signal. See `filter_both_ways`."""
    for s in range(len(settled)):
        for k in range(len(value)):
            state[2 * s, k] = settled[s, 0] * value[k]
            state[2 * s + 1, k] = settled[s, 1] * value[k]


@long_running
def _pass_sections(value, state, sections):
    """Replace a sample of each signal by the filtered one. See `filter_both_ways`."""
    for s in range(len(sections)):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        first, second = state[2 * s], state[2 * s + 1]
        for k in range(len(value)):
            x = value[k]
            y = b0 * x + first[k]
            first[k] = b1 * x - a1 * y + second[k]
            second[k] = b2 * x - a2 * y
            value[k] = y


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
