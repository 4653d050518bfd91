import os
import time

import pytest

from fmu.export import export_fmu


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """Export an automaton once a session and version, whatever the number of test processes; equal keys share it."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    folder = folder / "fmus"
    folder.mkdir(exist_ok=True)
    own = tmp_path_factory.mktemp("exports")

    def export(automaton, key=None, fmi="3.0"):
        key = (key or automaton.name) + ("" if fmi == "3.0" else f"-fmi{fmi}")
        path, claim = folder / f"{key}.fmu", folder / f"{key}.claim"
        while not path.exists():
            try:
                # Whoever makes the claim makes the FMU; the others wait for it.
                claim.mkdir()
            except FileExistsError:
                time.sleep(0.05)
                continue
            try:
                os.replace(export_fmu(automaton, own / f"{key}.fmu", fmi=fmi), path)
            finally:
                claim.rmdir()
        return path

    return export
