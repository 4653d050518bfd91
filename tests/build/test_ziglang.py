"""The C compiler of the package ziglang, the fallback where there is no other: no warning, and the same runs."""

import re
import sys
import zipfile

import numpy as np
import pytest
from fmi_driver.binary import Binary
from fmi_driver.journey import instance
from fmi_driver.runs import advance
from witnesses import Mix

from fmu.export import export_fmu
from fmu.validate.binaries.binary import read_binary

pytestmark = pytest.mark.long


@pytest.fixture
def by_zig(tmp_path, monkeypatch):
    pytest.importorskip("ziglang", reason="the package ziglang is not installed")
    monkeypatch.setenv("CC", f"{sys.executable} -m ziglang cc")
    return export_fmu(Mix(), tmp_path / "mix.fmu")


def test_its_fmu_runs_as_the_usual_one(by_zig, exported):
    """Warnings are errors for it too; its libm may differ in the last bit."""
    records = []
    for path in (exported(Mix(), "mix"), by_zig):
        for label in ("3.0 CS", "3.0 CS without events"):
            component = instance(Binary(path), label)
            component.initialize(0.0, 3.0)
            records.append(advance(component, [0.25 * k for k in range(13)]))
            component.free()
    for usual, other in zip(records[:2], records[2:], strict=True):
        assert [clocks for _, clocks in other.ticks] == [clocks for _, clocks in usual.ticks]
        np.testing.assert_allclose([t for t, _ in other.ticks], [t for t, _ in usual.ticks], rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            [values for _, values in other.samples], [values for _, values in usual.samples], rtol=0, atol=1e-10
        )
    assert len(records[0].ticks) > 10


def test_its_fmu_exports_fmi_functions_only_and_runs_on_old_systems(by_zig):
    with zipfile.ZipFile(by_zig) as archive:
        [member] = [name for name in archive.namelist() if name.startswith("binaries/")]
        library = archive.read(member)
    names = read_binary(library).exports
    assert names
    assert [name for name in names if not name.startswith("fmi")] == []
    # The target is set for this machine too: without one, zig builds for its processor and its C library.
    versions = {tuple(map(int, found)) for found in re.findall(rb"GLIBC_(\d+)\.(\d+)", library)}
    assert max(versions, default=(0, 0)) <= (2, 17)
