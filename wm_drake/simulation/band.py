"""Filters of measures: pass band of displacements, high-pass of RMS values; no record is needed."""

import numpy as np

from wm_drake.parameters import SpinProfile

LOWER_EDGE = 0.5
"""Lower edge of the pass band without one in the profile. [Hz]

Slower motion, such as the shift of the mean at a change of speed, does not count as vibration. It
is also the lower edge in [B] section 2.2.
"""

LEAST_UPPER_EDGE = 20.0
"""Smallest upper edge of the pass band without one in the profile. [Hz]

An assumption: slow machines keep the orders that their friction causes. It is also the upper edge
in [B] section 2.2, where the drum turns at up to 400 rpm.
"""

ORDERS_PASSED = 2.5
"""Smallest ratio of the upper band edge to the highest drum frequency: two orders pass.

An assumption; in [B] the ratio is 3.
"""

HIGHEST_PART = 0.45
"""Largest ratio of an upper band edge to the sampling frequency."""

FILTER_ORDER = 4
"""Order of the Butterworth filter ([B] section 2.2).

The filter runs forwards and backwards, so that it shifts no phase.
"""

PADDING_PERIODS = 2.5
"""Length by which displacements are mirrored at both ends, in periods of the lower band edge.

With the padding that scipy chooses, a record that ends at a resonance would show peaks that are a
third too large near its end.
"""

HIGH_PASS_HZ = 0.5
"""Corner frequency of the filter: the lower band edge of [B] section 2.2.

Slower motion does not count as vibration. There is no upper band edge, because the RMS includes all
drum speeds.
"""

RMS_FILTER_ORDER = 4
"""Order of the Butterworth filters, which run forwards and backwards and so shift no phase."""


def pass_band(profile: SpinProfile, period: float) -> tuple[float, float]:
    """Return the pass band of the displacements of a run. [Hz]

    It is that of the profile. A profile without one has a band up to `ORDERS_PASSED` times the
    highest drum frequency, since 20 Hz would cut the motion at 1200 rpm in half.

    Args:
        period: Time between samples. [s]
    """
    low, high = profile.band or (
        LOWER_EDGE,
        max(LEAST_UPPER_EDGE, ORDERS_PASSED * profile.highest_speed / (2.0 * np.pi)),
    )
    return low, max(min(high, HIGHEST_PART / period), 1.001 * low)


def band_warnings(profile: SpinProfile) -> list[str]:
    """Return a warning if the pass band of a profile cuts its highest speed.

    A band that `pass_band` chooses reaches beyond it, and so do the samples.
    """
    highest = profile.highest_speed / (2.0 * np.pi)
    if profile.band is None or highest == 0.0 or profile.band[0] <= highest <= profile.band[1]:
        return []
    low, high = profile.band
    return [
        f"the pass band of displacements, {low:g} to {high:.3g} Hz, cuts the highest drum speed, "
        f"{60.0 * highest:.4g} rpm or {highest:.3g} Hz, so amplitudes are too small; remove "
        "profile.band or widen it"
    ]
