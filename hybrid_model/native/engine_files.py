"""The C files of the engine, which knows nothing of FMI."""

from pathlib import Path

__all__ = ["ENGINE_FOLDERS", "RUNS_FOLDERS"]

_ENGINE = Path(__file__).resolve().parents[1] / "engine"
ENGINE_FOLDERS = (_ENGINE, _ENGINE / "location", _ENGINE / "methods", _ENGINE / "networks", _ENGINE / "schedule")
"""Folders of its C sources and headers; files of all include each other by name alone."""
RUNS_FOLDERS = (_ENGINE / "runs",)
"""What a process calls that has loaded the engine as a library; no FMU contains it."""
