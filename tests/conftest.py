import pytest

from fmu.export import export_fmu


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """Export an automaton once a session; equal keys share the file."""
    folder = tmp_path_factory.mktemp("fmus")
    files = {}

    def export(automaton, key=None):
        key = key or automaton.name
        if key not in files:
            files[key] = export_fmu(automaton, folder / f"{key}.fmu")
        return files[key]

    return export
