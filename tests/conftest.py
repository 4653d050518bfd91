import os
import time

import pytest

from fmu.export import export_fmu


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """Export an automaton once a session, whatever the number of test processes; equal keys share the file."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    folder = folder / "fmus"
    folder.mkdir(exist_ok=True)
    own = tmp_path_factory.mktemp("exports")

    def export(automaton, key=None):
        key = key or automaton.name
        path, claim = folder / f"{key}.fmu", folder / f"{key}.claim"
        while not path.exists():
            try:
                # Whoever makes the claim makes the FMU; the others wait for it.
                claim.mkdir()
            except FileExistsError:
                time.sleep(0.05)
                continue
            try:
                os.replace(export_fmu(automaton, own / f"{key}.fmu"), path)
            finally:
                claim.rmdir()
        return path

    return export
