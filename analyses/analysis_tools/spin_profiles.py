"""Shorter spin profiles with regions, to save time."""

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.spin import Region


def faster_profile(profile: SpinProfile, factor: float) -> SpinProfile:
    """Return a profile with all times divided by a factor."""
    regions = [
        Region(name=r.name, begin=r.begin / factor, end=r.end / factor) for r in profile.regions
    ]
    times = tuple(time / factor for time in profile.time)
    return SpinProfile(time=times, speed=profile.speed, regions=tuple(regions))


def begin_of(profile: SpinProfile) -> SpinProfile:
    """Return the first region of a profile."""
    end = profile.regions[0].end
    speed = 0.0, float(profile.speed_at(end))
    return SpinProfile(time=(0.0, end), speed=speed, regions=profile.regions[:1])
