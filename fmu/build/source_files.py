"""The folder ``sources/`` of an FMU: everything that a C99 compiler needs to build the binary again, anywhere.

The standard leaves the FMI header files to the importer. They are here nevertheless, in a folder of their own where the
version of the standard can say so (FMI 3.0: IncludeDirectory), so that the archive alone is enough.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from pathlib import Path

from fmu.build.binaries import fmi_headers, own_files
from fmu.describe.variables import Fmi
from fmu.describe.xml_text import to_bytes

MODEL = "model.c"
"""The generated file."""
HEADER_FOLDER = "fmi"
_HEADERS = {
    Fmi.V2_0: ("fmi2FunctionTypes.h", "fmi2Functions.h", "fmi2TypesPlatform.h"),
    Fmi.V3_0: ("fmi3FunctionTypes.h", "fmi3Functions.h", "fmi3PlatformTypes.h"),
}
_OTHER = {Fmi.V2_0: "fmi3", Fmi.V3_0: "fmi2"}
_OPTIONS = "-O2 -fPIC -fvisibility=hidden -ffp-contract=off"
"""Of gcc and clang: only FMI functions are exported, and results are those of the binaries bit for bit."""
_UNIX = ("x86_64-linux", "aarch64-linux", "x86_64-darwin", "aarch64-darwin")


def runtime_files(fmi: Fmi) -> list[Path]:
    """Return the runtime's C files and headers for a version of the standard, sorted by name.

    Parameters
    ----------
    fmi : Fmi
        Version; the thin layer of the other one is left out.
    """
    return [file for file in own_files("*.[ch]") if not file.name.startswith(_OTHER[fmi])]


def source_names(fmi: Fmi) -> list[str]:
    """Return the C files to compile, relative to ``sources/``.

    Parameters
    ----------
    fmi : Fmi
        Version of the standard.
    """
    return sorted([MODEL, *(file.name for file in runtime_files(fmi) if file.suffix == ".c")])


def source_members(model_code: str, identifier: str, fmi: Fmi) -> dict[str, bytes]:
    """Return the members of an FMU's archive below ``sources/``.

    Parameters
    ----------
    model_code : str
        The generated C file.
    identifier : str
        The model identifier.
    fmi : Fmi
        Version of the standard.

    Returns
    -------
    dict of str to bytes
        C files, headers, and for FMI 3.0 the build description. FMI 2.0 lists its files in modelDescription.xml and
        knows no folders for headers: there all files are side by side.

    Raises
    ------
    BuildError
        If the FMI header files are missing.
    """
    members: dict[str, bytes] = {MODEL: model_code.encode("ascii")}
    members |= {file.name: file.read_bytes() for file in runtime_files(fmi)}
    folder = f"{HEADER_FOLDER}/" if fmi is Fmi.V3_0 else ""
    members |= {f"{folder}{name}": (fmi_headers() / name).read_bytes() for name in _HEADERS[fmi]}
    if fmi is Fmi.V3_0:
        members["buildDescription.xml"] = build_description(
            identifier, source_names(fmi), {"": "", **dict.fromkeys(_UNIX, _OPTIONS)}
        )
    return {f"sources/{name}": content for name, content in members.items()}


def build_description(identifier: str, sources: Iterable[str], options: Mapping[str, str]) -> bytes:
    """Return buildDescription.xml, after the FMI standard 3.0, section 2.5.1.4.

    Parameters
    ----------
    identifier : str
        The model identifier.
    sources : iterable of str
        C files, relative to ``sources/``.
    options : mapping of str to str
        Platform -> compiler options; the platform ``""`` stands for all others. Where options are given, the
        mathematical library is linked by name.

    Returns
    -------
    bytes
        XML in UTF-8, valid by fmi3BuildDescription.xsd.
    """
    files = list(sources)
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    for platform, flags in options.items():
        attributes = {"modelIdentifier": identifier} | ({"platform": platform} if platform else {})
        configuration = ET.SubElement(root, "BuildConfiguration", attributes)
        given = {"compilerOptions": flags} if flags else {}
        group = ET.SubElement(configuration, "SourceFileSet", {"language": "C99", **given})
        for name in files:
            ET.SubElement(group, "SourceFile", name=name)
        ET.SubElement(group, "IncludeDirectory", name=HEADER_FOLDER)
        if flags:
            ET.SubElement(configuration, "Library", name="m", external="true")
    return to_bytes(root)
