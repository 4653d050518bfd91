"""How many cases a test draws: some in `make test`, many where fresh ones are asked for."""

from hypothesis import settings


def examples(some, many):
    """Settings of a test whose cases cost much, most of them a model to compile: `make test-long` draws `many`."""
    return settings(max_examples=some if settings.default.derandomize else many, deadline=None)
