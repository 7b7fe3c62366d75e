"""Memory and time that a run needs, and the memory that this computer has for it."""

import resource
from pathlib import Path

from wm_drake.compiler.lanes import WIDTH
from wm_drake.errors import input_error
from wm_drake.parameters import SpinProfile

NUMBERS_OF_SAMPLE = 40
"""Numbers that a run keeps for each sample in each lane: state, displacements, forces.

Measured as the growth of the peak of memory with the length of the run, 20,000 and 80,000 samples,
`reference`: 26 to 35 by measures, which include the transient copies; 40 is on the safe side.
"""

NUMBERS_OF_STEP = 28
"""Numbers of the schedule for each step, and of its construction, at the peak (measured)."""

RECORDS_OF_BATCH = 2.5
"""Memory of a batch that makes records, by that of one without (measured)."""

SECONDS_OF_STEP = 3e-6
"""Time of a step on one core: 2.5 to 4 us with gasket and three dampers, by measures. [s]"""

_BYTES, _GB = 8, 1e9


def check_size(profile: SpinProfile, step: float, period: float, at_once: float = 1.0) -> None:
    """Check that a run has a place in the memory of this computer.

    Args:
        profile: Spin profile of the run.
        step: Step size. [s]
        period: Time between samples. [s]
        at_once: How many times its memory is needed at once.

    Raises:
        InputError: it needs more memory than is available.
    """
    steps, needed = profile.duration / step, at_once * needed_memory(profile, step, period)
    available = available_memory()
    if needed <= available:
        return
    raise input_error(
        f"a run of {profile.duration:g} s in steps of {1e3 * step:g} ms needs about "
        f"{needed / _GB:.3g} GB of memory and {SECONDS_OF_STEP * steps:.2g} s; "
        f"{available / _GB:.3g} GB are available: shorten the profile or lengthen the step",
        key="profile",
    )


def needed_memory(profile: SpinProfile, step: float, period: float) -> float:
    """Return the memory that a run needs, arguments as for `check_size`. [byte]"""
    samples, steps = profile.duration / period, profile.duration / step
    return _BYTES * (NUMBERS_OF_SAMPLE * WIDTH * samples + NUMBERS_OF_STEP * steps)


def available_memory() -> float:
    """Return the memory that this process can still take. [byte]"""
    free = [_of_computer(), _of_group(), _of_process()]
    return max(0.0, min(limit for limit in free if limit is not None))


def _of_computer() -> float:
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            return 1024.0 * float(line.split()[1])
    return float("inf")  # not Linux: the run itself finds out


def _of_group() -> float | None:
    """Return what the control group of a container leaves; None without a limit."""
    numbers = [
        text
        for name in ("memory.max", "memory.current")
        for text in _lines(f"/sys/fs/cgroup/{name}")
    ]
    if len(numbers) != 2 or not all(text.strip().isdecimal() for text in numbers):
        return None
    return float(numbers[0]) - float(numbers[1])


def _of_process() -> float | None:
    """Return what the limit of the address space leaves; None without a limit."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    pages = _lines("/proc/self/statm")
    if limit == resource.RLIM_INFINITY or not pages:
        return None
    return float(limit - int(pages[0].split()[0]) * resource.getpagesize())


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text(encoding="ascii").splitlines()
    except OSError:
        return []
