"""Its tests of `hm.simulate` run on both engines."""

from both_engines import engine

__all__ = ["engine"]
