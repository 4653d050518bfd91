"""A Co-Simulation FMU in a file: what its description says, and its binary, loaded once for all runs."""

from __future__ import annotations

import math
import shutil
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmpy.model_description import ValidationError

from cosim.errors import CosimError
from fmu.archives.reading import Archive
from fmu.importer.instance import FmuInstance
from fmu.importer.loading import major_of, read_description
from fmu.importer.temporary_folders import temporary_folder
from fmu.importer.unpacking import unpack

_alone: dict[str, str] = {}
OWN_TOOL = "hybrid-fmu"
"""What FMUs that this project exports say of their tool."""
STOP_AT_EVENTS = "stop_at_events"
"""Their parameter in FMI 2.0 that lets a step end after an event, with fmi2Discard."""


class FmuFile:
    """An FMU of FMI 2.0 or 3.0 for Co-Simulation.

    Parameters
    ----------
    name : str
        Of the slave, for messages.
    path : str or Path
    validate : bool
        Whether to hold the description against the schema and fmpy's checks.
    kind : {"CoSimulation", "ModelExchange"}
        The interface that is used.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
    start_time, stop_time, step : float or None
        What the description proposes for a run, in s.
    internal_step : float or None
        Length in s of the steps that its solver makes, if they have one and there is a state to integrate.

    Raises
    ------
    CosimError
        If the file is no such FMU, or its archive must not be extracted.
    """

    def __init__(self, name: str, path: str | Path, *, validate: bool, kind: str = "CoSimulation") -> None:
        try:
            self.description = read_description(path, validate=validate)
        except ValidationError as error:
            raise CosimError(
                f"{name}: {path} cannot be read as an FMU: {error}\n`hybrid-fmu validate` says more; validate=False "
                "(--no-validate) goes on all the same."
            ) from error
        except FileNotFoundError as error:
            raise CosimError(f"{name}: there is no file {path}: give the path of an FMU.") from error
        except Exception as error:
            raise CosimError(f"{name}: {path} cannot be read as an FMU: {error}") from error
        self.kind, self.interface = kind, getattr(self.description, kind[0].lower() + kind[1:])
        if major_of(self.description) is None or self.interface is None:
            wanted = kind.replace("CoS", "Co-S").replace("lE", "l E")
            raise CosimError(
                f"{name}: {path} is not an FMI 2.0 or 3.0 {wanted} FMU (it says FMI "
                f"{self.description.fmiVersion}, {_interfaces(self.description)}): export it as one."
            )
        self._name, self._path = name, path
        self._loaded: FmuInstance | None = None
        experiment = self.description.defaultExperiment
        self.start_time, self.stop_time, self.step = (
            _seconds(getattr(experiment, attribute, None)) for attribute in ("startTime", "stopTime", "stepSize")
        )
        self.internal_step = _seconds(getattr(self.interface, "fixedInternalStepSize", None))
        if self.step is None:
            self.step = self.internal_step
        if self.description.modelExchange is not None and not self.description.derivatives:
            # The model is all there, and without a continuous state no output waits for a step of a solver.
            self.internal_step = None

    @property
    def ours(self) -> bool:
        """Whether this project's exporter made it."""
        return str(self.description.generationTool).startswith(OWN_TOOL)

    @property
    def stops_after_events(self) -> bool:
        """Whether it ends its steps after its events, if `STOP_AT_EVENTS` is set."""
        return self.ours and any(v.name == STOP_AT_EVENTS for v in self.description.modelVariables)

    def claim(self) -> None:
        """Note that an instance is about to be made.

        Raises
        ------
        CosimError
            If there is one already in this process, and the FMU allows no other.
        """
        if not self.interface.canBeInstantiatedOnlyOncePerProcess:
            return
        other = _alone.setdefault(self.description.guid, self._name)
        if other != self._name:
            raise CosimError(
                f"{self._name} and {other} are one FMU, of which a process may have one instance at a time "
                "(canBeInstantiatedOnlyOncePerProcess is true): run them in two processes."
            )

    def yield_claim(self) -> None:
        """Note that the instance is gone, or could not be made."""
        if _alone.get(self.description.guid) == self._name:
            del _alone[self.description.guid]

    def load(self, hear: Callable[[int, str], None]) -> FmuInstance:
        """Load the binary, if nobody has, and return its instance to be.

        Parameters
        ----------
        hear : callable
            Told the status and the text of each message; it does not keep this object.

        Raises
        ------
        CosimError
            If there is no binary for this machine, or it cannot be loaded.
        """
        if self._loaded is None:
            try:
                unpacked = self._unpacked()
                self._loaded = FmuInstance(self.description, unpacked.folder, self._name, hear, self.kind)
            except Exception as error:
                raise CosimError(f"{self._name}: {self._path} cannot be loaded on this machine: {error}") from error
            weakref.finalize(self, _unload, self._loaded.fmu, unpacked)
        return self._loaded

    def _unpacked(self) -> _Unpacked:
        """Return the FMU on disk: ours keep nothing outside of instances, so all of one file share one library."""
        if not self.ours:
            return _Unpacked(self._path)
        told = Path(self._path).stat()
        key = str(Path(self._path).resolve()), told.st_mtime_ns, told.st_size
        return _ours.get(key) or _ours.setdefault(key, _Unpacked(self._path))


class _Unpacked:
    """An FMU on disk, for as long as somebody uses it."""

    def __init__(self, path: str | Path) -> None:
        self.folder = temporary_folder()
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        with Archive(path) as archive:
            unpack(archive, self.folder)


_ours: weakref.WeakValueDictionary[tuple[str, int, int], _Unpacked] = weakref.WeakValueDictionary()


def _interfaces(description: Any) -> str:
    offered = {
        "Co-Simulation": description.coSimulation,
        "Model Exchange": description.modelExchange,
        "Scheduled Execution": description.scheduledExecution,
    }
    return " and ".join(name for name, interface in offered.items() if interface is not None) or "no interface"


def _seconds(text: str | None) -> float | None:
    """Return a time of the description, if it says a usable one."""
    try:
        value = math.nan if text is None else float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _unload(fmu: Any, unpacked: _Unpacked) -> None:
    fmu.freeLibrary()
    del unpacked  # the file is there until its library is not
