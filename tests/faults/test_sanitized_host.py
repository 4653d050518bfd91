"""A binary built with sanitizers in a foreign importer: fmpy, in a Python process that loads their libraries first."""

import os
import subprocess
import sys
import zipfile

import pytest
from c_harness import VERSIONS
from witnesses import Mix

from fmu.build.binaries import OWN_FOLDERS, fmi_headers, runtime_sources
from fmu.export import export_fmu
from hybrid_model.native.build.compiler import find_compiler

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform != "linux", reason="LD_PRELOAD"),
]
SIMULATE = """
import sys
import fmpy
import numpy as np
path, folder = sys.argv[1:3]
for kind in ("CoSimulation", "ModelExchange"):
    events = kind == "CoSimulation"
    found = fmpy.simulate_fmu(folder, stop_time=3.0, output_interval=0.1, fmi_type=kind, relative_tolerance=1e-9,
                              output=["x[1]", "x[2]", "total"])
    print(kind, *(repr(float(found[-1][name])) for name in ("x[1]", "x[2]", "total")))
"""


def library(name):
    found = subprocess.run([*find_compiler(), f"-print-file-name={name}"], capture_output=True, text=True, check=True)
    path = found.stdout.strip()
    if not os.path.isabs(path):
        pytest.skip(f"the compiler has no {name}")
    return os.path.realpath(path)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_fmpy_runs_it_without_a_word(fmi, tmp_path):
    path, folder = tmp_path / "mix.fmu", tmp_path / "mix"
    export_fmu(Mix(), path, fmi=fmi)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    [binary] = (folder / "binaries").rglob("*.so")
    plain = binary.read_bytes()
    generated = folder / "sources" / "model.c"
    sources = [generated, *runtime_sources(fmi)]
    flags = ["-std=c99", "-O1", "-g", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off"]
    flags += [
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        *(f"-I{folder}" for folder in OWN_FOLDERS),
        "-isystem",
        str(fmi_headers()),
    ]
    preloaded = os.environ | {
        "LD_PRELOAD": f"{library('libasan.so')}:{library('libubsan.so')}",
        # Python and the libraries of fmpy keep memory until the end.
        "ASAN_OPTIONS": "detect_leaks=0",
    }
    found = {}
    for kind in ("plain", "sanitized"):
        if kind == "sanitized":
            subprocess.run([*find_compiler(), *flags, *map(str, sources), "-o", str(binary), "-lm"], check=True)
            assert binary.read_bytes() != plain
        done = subprocess.run(
            [sys.executable, "-c", SIMULATE, str(path), str(folder)],
            capture_output=True,
            text=True,
            check=False,
            env=preloaded if kind == "sanitized" else None,
        )
        assert done.returncode == 0, done.stderr[-3000:]
        assert "Sanitizer" not in done.stderr + done.stdout
        assert "runtime error" not in done.stderr
        found[kind] = [line.split() for line in done.stdout.splitlines()]
    assert [line[0] for line in found["plain"]] == ["CoSimulation", "ModelExchange"]
    for one, other in zip(found["plain"], found["sanitized"], strict=True):
        # Another optimisation of the solver's sums; fmpy's own integration is the same in both.
        assert [float(v) for v in one[1:]] == pytest.approx([float(v) for v in other[1:]], rel=1e-9)
