"""The tests of this room run on both engines."""

from both_engines import engine, on_both_engines

pytest_generate_tests = on_both_engines

__all__ = ["engine", "pytest_generate_tests"]
