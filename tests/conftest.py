"""Settings for all tests: property tests draw the same examples in every run."""

from hypothesis import settings

settings.register_profile("fixed", derandomize=True)
settings.load_profile("fixed")
