import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from small_fmus import stubs
from strangers import write_stranger3

from fmu.build.binaries import fmi_headers

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def foreign_binary(tmp_path_factory):
    """Compile a C source beside this file, once a session and process."""
    if sys.platform != "linux" or shutil.which("gcc") is None:
        pytest.skip("FMUs that are not ours are built by gcc on Linux")
    folder, made = tmp_path_factory.mktemp("foreign"), {}

    def compiled(source):
        if source not in made:
            made[source] = folder / f"{Path(source).stem}.so"
            files = [HERE / source, stubs(folder, 3 if source == "stranger3.c" else 2)]
            command = ["gcc", "-shared", "-fPIC", "-w", f"-I{fmi_headers()}", *files, "-o", made[source], "-lm"]
            subprocess.run(command, check=True)
        return made[source]

    return compiled


@pytest.fixture
def stranger(foreign_binary, tmp_path):
    """Write somebody else's FMU of FMI 3.0, `stranger.fmu`; see `write_stranger3`."""

    def write(name="stranger", **told):
        return write_stranger3(tmp_path / f"{name}.fmu", foreign_binary("stranger3.c"), **told)

    return write
