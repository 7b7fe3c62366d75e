"""Settings of the property tests: the same examples in every run, no limit on the first, compiling call."""

from hypothesis import settings

settings.register_profile("same_every_time", derandomize=True, deadline=None, database=None)
settings.load_profile("same_every_time")
