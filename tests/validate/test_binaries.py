"""Readers of shared libraries: on other people's builds for all platforms, against `nm`, and on damaged bytes."""

import contextlib
import random
import shutil
import subprocess
from pathlib import Path

import fmpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_fmus import EXTENSION, binary

from fmu.standard.functions import required
from fmu.validate.binaries.binary import read_binary
from fmu.validate.binaries.shared_library import BinaryError

PLACES = Path(fmpy.__path__[0])
CONTAINERS = sorted((PLACES / "container_fmu" / "binaries").rglob("container_fmu.*"))
LIBRARIES = sorted(path for ending in ("so", "dll", "dylib") for path in PLACES.rglob(f"*.{ending}"))


@pytest.mark.parametrize("path", CONTAINERS, ids=lambda path: path.parent.name)
def test_an_fmu_of_another_compiler_for_each_platform(path):
    """One Rust source, built by its authors for four platforms: the FMI functions are the same in all."""
    found = read_binary(path.read_bytes())
    machine, system = path.parent.name.split("-")
    assert (found.system, found.machines) == (system, {machine})
    assert set(required(2, "CoSimulation")) | set(required(3, "CoSimulation")) <= found.exports
    assert found.imports
    assert not found.imports & found.exports


def test_all_platforms_are_there():
    assert {path.suffix for path in LIBRARIES} == {".so", ".dll", ".dylib"}


@pytest.mark.skipif(shutil.which("nm") is None, reason="nm is the oracle")
def test_exports_and_imports_agree_with_nm():
    for path in [path for path in LIBRARIES if path.suffix == ".so"]:
        found = read_binary(path.read_bytes())
        for option, names in (("--defined-only", found.exports), ("--undefined-only", found.imports)):
            listed = subprocess.run(["nm", "-D", option, str(path)], capture_output=True, text=True, check=True).stdout
            kinds = {"--defined-only": "TDBRVWuiG", "--undefined-only": "UwWv"}[option]
            rows = [line.split() for line in listed.splitlines()]
            expected = {row[-1].partition("@")[0] for row in rows if row[-2] in kinds}
            assert names == expected - {"_init", "_fini", "_edata", "_end", "__bss_start"}, path.name


@pytest.mark.skipif(EXTENSION != ".so", reason="options of the ELF linker")
@pytest.mark.parametrize("style", ["sysv", "gnu"])
def test_both_hash_tables_lead_to_all_symbols(style):
    found = read_binary(binary(3, f"-Wl,--hash-style={style}"))
    assert set(required(3, "CoSimulation")) <= found.exports


@pytest.mark.parametrize("path", CONTAINERS, ids=lambda path: path.parent.name)
def test_cut_files_are_refused(path):
    content = path.read_bytes()
    for end in (0, 3, 10, 64, 300, 1000, 5000):
        with pytest.raises(BinaryError):
            read_binary(content[:end])


@pytest.mark.parametrize("path", CONTAINERS, ids=lambda path: path.parent.name)
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), flips=st.integers(1, 40), head=st.sampled_from([512, 4096, 1 << 20]))
def test_damaged_files_are_read_or_refused(path, seed, flips, head):
    """No other exception leaves a reader, and none runs for ever."""
    content = bytearray(path.read_bytes())
    chance = random.Random(seed)
    for _ in range(flips):
        content[chance.randrange(min(head, len(content)))] = chance.choice(
            [0, 1, 0x7F, 0x80, 0xFF, chance.randrange(256)]
        )
    with contextlib.suppress(BinaryError):
        read_binary(bytes(content))


@given(st.sampled_from([b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b""]), st.binary(max_size=400))
def test_random_bytes_are_refused(magic, rest):
    with pytest.raises(BinaryError):
        read_binary(magic + rest)
