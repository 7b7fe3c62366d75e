"""Water that leaves the laundry while the drum spins."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import where


@law
def draining_rate(left, lasting, time_constant):
    """Return the rate of the share of water that is left in a mass.

        f' = -max(0, f - f_s)/tau      own choice: first order, and water does not come back

    Args:
        left: f, share of the water at the start that is left.
        lasting: f_s, share that is left after a long time at the speed of the drum.
        time_constant: tau, > 0. [s]

    Returns:
        f', <= 0. [1/s]
    """
    above = left - lasting
    return where(above > 0.0, -above / time_constant, 0.0 * above)
