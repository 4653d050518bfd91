"""Which archives must not be extracted, and why; judged by the directory of the archive alone.

Names are read with '/' for each backslash: so they are judged, and so the files are extracted.
"""

from __future__ import annotations

import itertools
import stat
import unicodedata
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

ENCRYPTED, STORED, DEFLATED = 0x1, 0, 8
DESCRIPTION = "modelDescription.xml"
_LOCAL_HEADER = 30
_DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows keeps for devices: no file there can be called so, with or without an ending."""


@dataclass(frozen=True)
class ArchiveLimits:
    """What an archive may hold.

    Attributes
    ----------
    entries : int
        Members.
    total_bytes : int
        All members unpacked, in bytes.
    ratio : float
        Unpacked to packed size of one member; asked of members larger than `ratio_from` bytes, for text of zeros and
        blanks packs well.
    ratio_from : int
    name_length : int
        Characters of a member's name.
    description : str
        The member that says what the archive is, and that it must have at its top.
    kind, standard : str
        What messages call such an archive, and what says how it is packed.
    """

    entries: int = 20_000
    total_bytes: int = 2 << 30
    ratio: float = 200.0
    ratio_from: int = 16 << 20
    name_length: int = 1024
    description: str = DESCRIPTION
    kind: str = "FMU"
    standard: str = "FMI"


LIMITS = ArchiveLimits()


def problems_of(archive: zipfile.ZipFile, limits: ArchiveLimits) -> Iterator[tuple[str, str]]:
    """Yield the rule and the sentence of each reason not to extract an archive."""
    members = archive.infolist()
    if len(members) > limits.entries:
        yield "entries", f"The archive has {len(members)} members; at most {limits.entries} are accepted."
        return
    for member in members:
        yield from _name_problems(member, limits)
        yield from _member_problems(member, limits)
    total = sum(member.file_size for member in members)
    if total > limits.total_bytes:
        yield "size", f"The archive unpacks to {total} bytes; at most {limits.total_bytes} are accepted."
    yield from _clashes(members)
    yield from _overlaps(members)
    if limits.description not in map(name_of, members):
        yield (
            "description",
            f"The archive has no {limits.description} at its top; every {limits.kind} has one: pack the folder's "
            "content.",
        )


def _name_problems(member: zipfile.ZipInfo, limits: ArchiveLimits) -> Iterator[tuple[str, str]]:
    shown = repr(member.orig_filename[:120])
    name = member.orig_filename.replace("\\", "/")  # `filename` is cut at a NUL and has the separators of this system
    parts = name.removesuffix("/").split("/")
    if name.startswith("/"):
        yield "absolute", f"The member {shown} is an absolute path; an {limits.kind} stays within its folder."
    elif "" in parts or "." in parts:
        yield "path", f"The member {shown} has an empty or '.' part; give a plain relative path."
    if ".." in parts:
        folder = f"the {limits.kind}'s folder"
        yield "traversal", f"The member {shown} leaves {folder} by '..'; give a plain relative path."
    if ":" in name:
        yield "drive", f"The member {shown} has a colon, which names a drive or stream on Windows; rename it."
    if any(unicodedata.category(c) in ("Cc", "Cs") for c in name):
        yield "control", f"The member {shown} has a control character in its name; rename it."
    if len(name) > limits.name_length or any(len(part.encode("utf-8", "replace")) > 255 for part in parts):
        yield "long", f"The member {shown} has a name of {len(name)} characters, which file systems refuse; shorten it."
    if any(part.rstrip(". ") != part for part in parts if part not in ("", ".", "..")):
        yield "trailing", f"The member {shown} ends in a dot or blank, which Windows drops; rename it."
    if any(is_device(part) for part in parts):
        yield "reserved", f"The member {shown} has the name of a Windows device; rename it."


def _member_problems(member: zipfile.ZipInfo, limits: ArchiveLimits) -> Iterator[tuple[str, str]]:
    shown = repr(member.orig_filename[:120])
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        what = "a symbolic link" if kind == stat.S_IFLNK else "a special file"
        yield "link", f"The member {shown} is {what}; an {limits.kind} holds plain files: put the file itself there."
    if member.flag_bits & ENCRYPTED:
        yield "encrypted", f"The member {shown} is encrypted, which {limits.standard} forbids; pack it in plain."
    if member.compress_type not in (STORED, DEFLATED):
        yield (
            "compression",
            f"The member {shown} has compression method {member.compress_type}; {limits.standard} allows 0 (store) and "
            "8 (deflate).",
        )
    if is_folder(member) and member.file_size:
        yield "folder", f"The folder {shown} holds {member.file_size} bytes; a folder holds none."
    if member.file_size > limits.ratio_from and member.file_size > limits.ratio * max(member.compress_size, 1):
        ratio = member.file_size / max(member.compress_size, 1)
        yield (
            "ratio",
            f"The member {shown} unpacks {ratio:.0f}-fold to {member.file_size} bytes; "
            f"at most {limits.ratio:g}-fold is accepted: it looks like a decompression bomb.",
        )


def is_device(name: str) -> bool:
    """Whether the name of a file or folder stands for a device on Windows."""
    return name.partition(".")[0].lower() in _DEVICES


def no_device(name: str) -> str:
    """Return `name`, or a name near to it that stands for no device."""
    return f"_{name}" if is_device(name) else name


def name_of(member: zipfile.ZipInfo) -> str:
    """Return the name of a member with '/' between folders."""
    return member.filename.replace("\\", "/")


def is_folder(member: zipfile.ZipInfo) -> bool:
    """Tell whether a member is a folder."""
    return name_of(member).endswith("/")  # `ZipInfo.is_dir` fails on an empty name


def remarks_of(archive: zipfile.ZipFile) -> Iterator[tuple[str, str]]:
    """Yield the rule and the sentence of what strict readers refuse, and no reader can take for another file."""
    members = archive.infolist()
    wrong = [member.orig_filename for member in members if "\\" in member.orig_filename]
    if wrong:
        yield (
            "backslash",
            f"{_some(wrong)} a backslash between folders, where ZIP has '/': other systems take it for a part of the "
            "name. Pack the FMU anew.",
        )
    twice = [name for name, times in Counter(map(name_of, members)).items() if times > 1]
    if twice:
        yield "duplicate", f"{_some(twice)} an entry twice, of equal content: strict readers refuse that."


def _some(names: list[str]) -> str:
    one, count = repr(names[0][:120]), len(names)
    return f"The member {one} has" if count == 1 else f"The member {one} and {count - 1} more have"


def _clashes(members: list[zipfile.ZipInfo]) -> Iterator[tuple[str, str]]:
    folded: dict[str, str] = {}
    files: set[str] = set()
    folders: set[str] = set()
    for member in members:
        name = name_of(member).removesuffix("/")
        key = unicodedata.normalize("NFC", name).casefold()
        if folded.get(key, name) != name:
            yield (
                "case",
                f"The members {folded[key][:120]!r} and {name[:120]!r} are one file on systems that ignore "
                "case: rename one.",
            )
        folded.setdefault(key, name)
        parts = key.split("/")
        if len(parts) <= 64:
            folders.update("/".join(parts[:depth]) for depth in range(1, len(parts)))
        else:
            yield "deep", f"The member {name[:120]!r} lies {len(parts)} folders deep; at most 64 are accepted."
        if not is_folder(member):
            files.add(key)
    for key in sorted(files & folders):
        yield "duplicate", f"The member {key[:120]!r} is a file and a folder at once."


def _overlaps(members: list[zipfile.ZipInfo]) -> Iterator[tuple[str, str]]:
    # Members that share bytes unpack to more than the limits on each one foresee.
    ordered = sorted(members, key=lambda member: member.header_offset)
    for first, second in itertools.pairwise(ordered):
        if first.header_offset + _LOCAL_HEADER + first.compress_size > second.header_offset:
            yield (
                "overlap",
                f"The members {first.orig_filename[:120]!r} and {second.orig_filename[:120]!r} share bytes of "
                "the archive: "
                "it looks like a decompression bomb.",
            )
            return
