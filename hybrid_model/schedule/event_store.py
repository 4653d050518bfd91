"""Where the events of a long run go: into memory, and past a limit, or if a folder is named, to files that grow.

The files hold the columns as plain numbers, one after the other, so that a run that ends early, in whatever way, leaves
what it has: `load_network_events` reads it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

from hybrid_model.errors import DataError
from hybrid_model.native.build.scratch import ScratchFolder
from hybrid_model.native.network_run import EventColumns
from hybrid_model.schedule.network_events import NetworkEvents

LIMIT = 50_000_000
"""Numbers in memory, some 400 MB, before events go to files."""
_VERSION = 1
_COLUMNS = {"t": "<f8", "part": "<u4", "jump": "<u4", "values": "<f8"}
_ABOUT = "network.json"


class EventStore:
    """Takes the events of a run as they come.

    Parameters
    ----------
    about : mapping
        What `NetworkEvents` needs besides the columns; it goes into the folder.
    width : int
        Numbers that an event has among its values.
    folder : Path, optional
        Where the events go at once; default: memory, and past the limit a folder that is gone with the run's result.
    limit : int, optional
        Numbers in memory, at most.

    Raises
    ------
    DataError
        If the folder cannot be written to, or has events of another run.
    """

    def __init__(
        self, about: Mapping[str, Any], width: int, folder: Path | None = None, limit: int | None = None
    ) -> None:
        self._about, self._width = dict(about), width
        self._limit = LIMIT if limit is None else limit
        self._chunks: list[EventColumns] = []
        self._numbers = 0
        self._passing: ScratchFolder | None = None
        self._files: dict[str, IO[bytes]] = {}
        self._folder = folder
        if folder is not None:
            self._open(folder)

    def keep(self, events: EventColumns) -> None:
        """Take some more events."""
        if not self._files:
            self._chunks.append(events)
            self._numbers += len(events.t) * (2 + self._width)
            if self._numbers <= self._limit:
                return
            self._passing = ScratchFolder()
            self._open(Path(self._passing.name))
            chunks, self._chunks = self._chunks, []
            for chunk in chunks:
                self._write(chunk)
            return
        self._write(events)

    def columns(self) -> EventColumns:
        """Return all events; those in files are mapped, not read."""
        if not self._files:
            return joined(self._chunks, self._width)
        folder = self._folder or Path(self._passing.name if self._passing else "")
        return _mapped(folder, self._width)

    def close(self) -> None:
        """Close the files."""
        for file in self._files.values():
            file.close()

    def discard(self) -> None:
        """Forget all events, for the run begins anew."""
        self.close()
        self._chunks.clear()
        if self._folder is not None:
            for name in (_ABOUT, *_COLUMNS):
                (self._folder / name).unlink(missing_ok=True)

    def _open(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if any((folder / name).exists() for name in (_ABOUT, *_COLUMNS)):
                raise DataError(f"{folder} has the events of a run already: name another folder, or remove it.")
            (folder / _ABOUT).write_text(
                json.dumps({"version": _VERSION, "width": self._width, **self._about}), encoding="utf-8"
            )
            self._files = {name: (folder / name).open("wb") for name in _COLUMNS}
        except OSError as error:
            raise DataError(f"the events cannot go to {folder}: {error.strerror or error}.") from error

    def _write(self, events: EventColumns) -> None:
        for name, kind in _COLUMNS.items():
            self._files[name].write(np.ascontiguousarray(getattr(events, name), dtype=kind).tobytes())
            self._files[name].flush()


def joined(chunks: list[EventColumns], width: int) -> EventColumns:
    """Return the events of a run that were taken one after the other."""
    return EventColumns(
        np.concatenate([np.zeros(0), *(chunk.t for chunk in chunks)]),
        np.concatenate([np.zeros(0, np.uint32), *(chunk.part for chunk in chunks)]),
        np.concatenate([np.zeros(0, np.uint32), *(chunk.jump for chunk in chunks)]),
        np.concatenate([np.zeros((0, width)), *(chunk.values for chunk in chunks)]),
    )


def load_network_events(folder: str | Path) -> NetworkEvents:
    """Read the events that a run of a network has left in a folder, also while it goes on, or after it was killed.

    Parameters
    ----------
    folder : path
        What ``simulate_network(..., events_to=folder)`` was given.

    Raises
    ------
    DataError
        If there are none.
    """
    folder = Path(folder)
    try:
        about = json.loads((folder / _ABOUT).read_text(encoding="utf-8"))
        if about.pop("version") != _VERSION:
            raise DataError(f"{folder} has the events of another version of this program.")
        columns = _mapped(folder, int(about.pop("width")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise DataError(
            f"{folder} has no events of a network: {why}. Give the folder that simulate_network(events_to=...) wrote."
        ) from error
    return NetworkEvents.of_columns(columns, **about)


def _mapped(folder: Path, width: int) -> EventColumns:
    """Map the columns as far as all of them go."""
    sizes = {"t": 8, "part": 4, "jump": 4, "values": 8 * width}
    count = min((folder / name).stat().st_size // size for name, size in sizes.items() if size)

    def column(name: str, *shape: int) -> Any:
        if count == 0 or 0 in shape:
            return np.zeros((count, *shape), _COLUMNS[name])
        return np.memmap(folder / name, dtype=_COLUMNS[name], mode="r", shape=(count, *shape))

    return EventColumns(column("t"), column("part"), column("jump"), column("values", width))
