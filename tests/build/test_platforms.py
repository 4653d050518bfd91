"""FMUs for other machines: folders in the archive, and what is in the libraries, read from their bytes.

The readers are those of `hybrid-fmu validate`, which share nothing with the writers.  Builds for other platforms are
marked `long`: the first one for each makes a C library, for Windows in minutes.
"""

import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

import fmu.build.binaries
import fmu.build.libraries
from fmu.build.binaries import compile_fmu, fmi_headers
from fmu.build.mach_o import export_only, universal
from fmu.build.platforms import PLATFORMS, chosen_platforms, library_members, this_platform
from fmu.describe.variables import Fmi
from fmu.errors import BuildError
from fmu.validate.binaries.binary import read_binary

VERSION = """
#include "fmi3Functions.h"
double hidden(double x) { return x * x; }
const char *fmi3GetVersion(void) { return hidden(1.0) > 0.0 ? "3.0" : ""; }
"""

needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="the package ziglang is not installed")


def members(names, fmi):
    """The archive's members for platforms, each library holding the name of its platform."""
    libraries = {PLATFORMS[name]: macho(name) for name in names}
    return library_members("Model", fmi, libraries)


def macho(name):
    processor = {"x86_64": 0x01000007, "aarch64": 0x0100000C}[name.partition("-")[0]]
    return struct.pack("<III", 0xFEEDFACF, processor, 0) + name.encode()


# ---- names ----


def test_fmi_3_has_a_folder_for_each_platform():
    assert members(PLATFORMS, "3.0") == {
        f"binaries/{name}/Model{extension}": macho(name)
        for system, extension in (("linux", ".so"), ("windows", ".dll"), ("darwin", ".dylib"))
        for name in (f"x86_64-{system}", f"aarch64-{system}")
    }


def test_fmi_2_has_names_of_its_own_for_x86():
    """FMI 2.0.4, section 2.3; a library of macOS can hold both processors' code."""
    found = members(PLATFORMS, "2.0")
    both = found.pop("binaries/darwin64/Model.dylib")
    assert found == {
        "binaries/linux64/Model.so": macho("x86_64-linux"),
        "binaries/win64/Model.dll": macho("x86_64-windows"),
        "binaries/aarch64-linux/Model.so": macho("aarch64-linux"),
        "binaries/aarch64-windows/Model.dll": macho("aarch64-windows"),
        "binaries/aarch64-darwin/Model.dylib": macho("aarch64-darwin"),
    }
    assert both == universal([macho("x86_64-darwin"), macho("aarch64-darwin")])


def test_importers_of_fmi_2_that_ignore_the_processor_find_what_was_made_on_their_machine():
    """fmpy looks into linux64 on all 64-bit machines, where the standard has code for x86."""
    library = {PLATFORMS["aarch64-linux"]: b"code"}
    assert library_members("Model", "2.0", library) == {"binaries/aarch64-linux/Model.so": b"code"}
    assert library_members("Model", "3.0", library, only_here=True) == {"binaries/aarch64-linux/Model.so": b"code"}
    assert library_members("Model", "2.0", library, only_here=True) == dict.fromkeys(
        ("binaries/aarch64-linux/Model.so", "binaries/linux64/Model.so"), b"code"
    )


def test_universal_libraries_hold_their_parts_on_page_boundaries():
    parts = [macho("x86_64-darwin"), macho("aarch64-darwin") * 2000]
    joined = universal(parts)
    magic, count = struct.unpack_from(">II", joined)
    assert (magic, count) == (0xCAFEBABE, 2)
    for k, part in enumerate(parts):
        processor, variant, offset, size, power = struct.unpack_from(">5I", joined, 8 + 20 * k)
        assert (processor, variant) == struct.unpack_from("<II", part, 4)
        assert offset % 2**power == 0
        assert joined[offset : offset + size] == part


def test_platforms_are_chosen_by_name():
    assert [entry.name for entry in chosen_platforms(["aarch64-linux", "x86_64-linux", "aarch64-linux"])] == [
        "x86_64-linux",
        "aarch64-linux",
    ]
    assert chosen_platforms(None) == (this_platform(),)
    with pytest.raises(BuildError, match=r"no platform 'linux64'. Remedy: choose from x86_64-linux, aarch64-linux"):
        chosen_platforms(["linux64"])
    with pytest.raises(BuildError, match="needs a platform"):
        chosen_platforms([])


def test_a_machine_without_a_platform_is_told_what_can_be_built(monkeypatch):
    monkeypatch.setattr("platform.machine", lambda: "riscv64")
    with pytest.raises(BuildError, match=r"'riscv64-\w+'.*Remedy: name one"):
        chosen_platforms(None)
    assert chosen_platforms(["x86_64-linux"])


# ---- libraries ----


@pytest.fixture(scope="module")
def archives(tmp_path_factory, forget_models):
    """The command line's exports for all platforms: by version, two of them, made by two users in two folders."""
    made = {}

    def export(fmi):
        if fmi not in made:
            folder = tmp_path_factory.mktemp(f"fmi-{fmi}")
            made[fmi] = []
            for name, mask in (("one", 0o022), ("a second", 0o077)):
                forget_models()
                made[fmi].append(exported(folder / name, fmi, mask))
        return made[fmi]

    return export


def exported(folder, fmi, mask):
    (folder / "tmp").mkdir(parents=True)
    command = [sys.executable, "-m", "cosim.cli.main", "export", "hybrid_model.models:BouncingBall", "--fmi", fmi]
    subprocess.run(
        [*command, "--platform", "all", "--out", "out"],
        cwd=folder,
        env={**os.environ, "TMPDIR": str(folder / "tmp")},
        umask=mask,
        check=True,
    )
    assert list((folder / "tmp").iterdir()) == []
    return folder / "out" / "BouncingBall.fmu"


def functions(fmi):
    major = fmi[0]
    header = (fmi_headers() / f"fmi{major}Functions.h").read_text()
    return set(re.findall(rf"^\s*FMI{major}_Export\s+fmi{major}\w+TYPE\s+(fmi{major}\w+);", header, re.MULTILINE))


def libraries(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")}


@pytest.mark.long
@needs_zig
@pytest.mark.parametrize("fmi", [version.value for version in Fmi])
class TestAllPlatforms:
    def test_two_exports_give_the_same_bytes(self, fmi, archives):
        first, second = archives(fmi)
        for name, library in libraries(first).items():
            assert libraries(second)[name] == library, name
        assert first.read_bytes() == second.read_bytes()

    def test_each_folder_holds_a_library_of_its_platform(self, fmi, archives):
        found = {}
        for name, library in libraries(archives(fmi)[0]).items():
            binary = read_binary(library)
            found[name.split("/")[1]] = {f"{machine}-{binary.system}" for machine in binary.machines}
        expected = {name: {name} for name in PLATFORMS}
        if fmi == "2.0":
            for system, folder in (("linux", "linux64"), ("windows", "win64"), ("darwin", "darwin64")):
                expected[folder] = expected.pop(f"x86_64-{system}")
            expected["darwin64"] = {"x86_64-darwin", "aarch64-darwin"}
        assert found == expected

    def test_fmi_functions_only_are_exported(self, fmi, archives):
        for name, library in libraries(archives(fmi)[0]).items():
            assert read_binary(library).exports == functions(fmi), name

    def test_the_systems_own_libraries_only_are_needed(self, fmi, archives):
        own = {
            "linux": r"lib[cm]\.so\.6",
            "windows": r"(?i)kernel32\.dll|api-ms-win-crt-\w+-l1-1-0\.dll",
            "darwin": r"/usr/lib/libSystem\.B\.dylib",
        }
        for name, library in libraries(archives(fmi)[0]).items():
            binary = read_binary(library)
            assert [needed for needed in binary.needed if not re.fullmatch(own[binary.system], needed)] == [], name
            assert (binary.rpaths, binary.flaws) == ((), ()), name

    def test_old_systems_are_enough(self, fmi, archives):
        """glibc 2.17 is of 2012; macOS 10.15 and 11.0 are of 2019 and 2020."""
        for name, library in libraries(archives(fmi)[0]).items():
            if name.endswith(".so"):
                asked = {tuple(map(int, found)) for found in re.findall(rb"GLIBC_(\d+)\.(\d+)", library)}
                assert asked
                assert max(asked) <= (2, 17), name
            if name.endswith(".dylib") and library[:4] == b"\xcf\xfa\xed\xfe":
                assert _macos(library) <= (11, 0), name

    def test_no_path_of_the_machine_is_inside(self, fmi, archives):
        places = [
            str(Path.home()),
            str(archives(fmi)[0].parents[1]),
            os.path.dirname(fmu.build.binaries.__file__),
            "hybrid-fmu-",
        ]
        for name, library in libraries(archives(fmi)[0]).items():
            assert [place for place in places if place.encode() in library] == [], name

    @pytest.mark.skipif(shutil.which("objdump") is None, reason="objdump is not installed")
    def test_every_processor_of_the_kind_can_run_it(self, fmi, archives, tmp_path):
        """No instruction on vectors longer than those that all x86_64 processors have."""
        [library] = [
            content for name, content in libraries(archives(fmi)[0]).items() if re.search("x86_64-l|linux64", name)
        ]
        (tmp_path / "library.so").write_bytes(library)
        listing = subprocess.run(["objdump", "-d", tmp_path / "library.so"], capture_output=True, text=True, check=True)
        assert "%xmm" in listing.stdout
        assert not re.search("%[yz]mm", listing.stdout)


def _macos(library):
    """The system that LC_BUILD_VERSION asks for."""
    place = 32
    for _ in range(struct.unpack_from("<I", library, 16)[0]):
        kind, size = struct.unpack_from("<II", library, place)
        if kind == 0x32:
            version = struct.unpack_from("<I", library, place + 12)[0]
            return version >> 16, version >> 8 & 0xFF
        place += size
    raise AssertionError("the library does not say which system it needs")


@pytest.mark.long
@needs_zig
@pytest.mark.parametrize("platform", ["x86_64-darwin", "aarch64-darwin"])
def test_hiding_names_keeps_a_library_of_macos_whole(platform, tmp_path, monkeypatch):
    """The linker's own hashes come out again, so the signature is understood; what is hidden is gone, nothing else."""
    (tmp_path / "model.c").write_text(VERSION)
    with monkeypatch.context() as patch:
        patch.setattr(fmu.build.libraries, "export_only", lambda library, prefix: library)
        raw = compile_fmu([tmp_path / "model.c"], [fmi_headers()], tmp_path / "raw", platform=platform).read_bytes()
    assert export_only(raw, "_") == raw
    hidden = export_only(raw, "_fmi")
    before, after = read_binary(raw), read_binary(hidden)
    assert after.exports == {"fmi3GetVersion"} < before.exports
    assert (after.imports, after.needed) == (before.imports, before.needed)
    assert len(hidden) == len(raw)
    assert export_only(hidden, "_fmi") == hidden


@pytest.mark.parametrize("content", [b"", b"\x7fELF" * 20, struct.pack("<8I", 0xFEEDFACF, 0, 0, 6, 0, 0, 0, 0)])
def test_what_is_no_library_of_macos_is_refused(content):
    with pytest.raises(BuildError, match="Remedy"):
        export_only(content, "_fmi")
