"""FMUs for other platforms, run here by emulators: libraries of Windows by Wine, those of Linux on aarch64 by QEMU.

The same driver in C runs each library and that of this machine; results must be equal but for the roundings of
mathematical libraries, which systems have of their own.
"""

import os
import shutil
import subprocess
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from catalogue import cases
from fmpy import read_model_description

from fmu.build.binaries import fmi_headers
from fmu.build.platforms import PLATFORMS, this_platform
from fmu.export import export_fmu
from hybrid_model.native.build.cache_folder import zig_folder
from hybrid_model.native.build.compiler import find_compiler, zig_compiler

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(find_spec("ziglang") is None, reason="the package ziglang is not installed"),
    pytest.mark.skipif(this_platform().name != "x86_64-linux", reason="emulators of other platforms are for this one"),
]
DRIVER = Path(__file__).parents[1] / "support" / "foreign_run.c"
MODELS = ("bouncing_ball", "newtons_cradle", "agent2_dynamic", "paper_dynamic", "event_triggered_lti_loop")
STOP, STEP = 2.0, 0.05
# Time and states are of the order of 1; an event's time is known to some roundings of the margin over its slope.
TOLERANCE = 1e-11


def emulator(platform):
    """The command that runs a program of another platform, or a skip."""
    if platform == "x86_64-linux":
        return []
    if platform == "x86_64-windows":
        names = ("wine64", "wine")
        command = next((found for name in names if (found := shutil.which(name))), None)
        return [command] if command else pytest.skip("Wine is not installed")
    command, libraries = shutil.which("qemu-aarch64"), Path("/usr/aarch64-linux-gnu")
    if command is None or not libraries.exists():
        pytest.skip("QEMU's qemu-aarch64, or the C library in /usr/aarch64-linux-gnu, is not installed")
    return [command, "-L", str(libraries)]


@pytest.fixture(scope="module", params=["x86_64-windows", "aarch64-linux"])
def platform(request):
    emulator(request.param)
    return request.param


def program(platform, folder):
    """The driver, built for a platform."""
    native = platform == "x86_64-linux"
    command = find_compiler() if native else [*zig_compiler(), "-target", PLATFORMS[platform].zig_target]
    path = folder / f"run-{platform}.exe"
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-D_DEFAULT_SOURCE", f"-I{fmi_headers()}"]
    libraries = [] if "windows" in platform else ["-ldl"]
    environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": str(zig_folder()), "ZIG_LOCAL_CACHE_DIR": str(folder)}
    subprocess.run([*command, *flags, DRIVER, "-o", path, *libraries], env=environment, check=True)
    return path


@pytest.fixture(scope="module")
def programs(tmp_path_factory, platform):
    folder = tmp_path_factory.mktemp("programs")
    return {name: program(name, folder) for name in ("x86_64-linux", platform)}


def run(program, platform, fmu, folder):
    """What the driver prints: kinds, and numbers."""
    description = read_model_description(str(fmu))
    with zipfile.ZipFile(fmu) as archive:
        library = f"binaries/{platform}/{description.coSimulation.modelIdentifier}{PLATFORMS[platform].extension}"
        archive.extract(library, folder)
    references = [
        v.valueReference
        for v in description.modelVariables
        if v.type == "Float64" and v.causality in ("output", "local") and not v.dimensions
    ]
    arguments = [description.instantiationToken, STOP, STEP, *references[:60]]
    command = [*emulator(platform), str(program), str(folder / library), *map(str, arguments)]
    environment = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(folder / "wine")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert lines.pop(0) == ["version", "3.0"]
    return [line[0] for line in lines], [[float(number) for number in line[1:]] for line in lines]


@pytest.mark.parametrize("name", MODELS)
def test_other_platforms_give_the_same_runs(name, platform, programs, tmp_path):
    fmu = export_fmu(cases()[name].automaton, tmp_path / "model.fmu", platforms=["x86_64-linux", platform])
    kinds, numbers = run(programs["x86_64-linux"], "x86_64-linux", fmu, tmp_path)
    assert "event" in kinds
    assert kinds.count("point") == round(STOP / STEP)
    found_kinds, found = run(programs[platform], platform, fmu, tmp_path)
    assert found_kinds == kinds
    for line, expected in zip(found, numbers, strict=True):
        assert line == pytest.approx(expected, rel=TOLERANCE, abs=TOLERANCE)
