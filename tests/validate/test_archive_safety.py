"""Archives that must not be extracted: refused with the rule that names the reason, before anything is written."""

import io
import stat
import struct
import time
import zipfile
import zlib

import pytest
from small_fmus import DESCRIPTIONS

from fmu.archives.checks import ArchiveLimits
from fmu.archives.reading import Archive, ArchiveError
from fmu.validate.check import check_fmu
from fmu.validate.findings import Severity

DESCRIPTION = ("modelDescription.xml", DESCRIPTIONS[3].encode())


def extract(path, folder):
    with Archive(path) as archive:
        return archive.extract(folder)


def pack(path, *entries, method=zipfile.ZIP_DEFLATED):
    """Write entries (name or ZipInfo, content), also such that zipfile itself would not write twice."""
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in entries:
            if isinstance(name, str):
                info = zipfile.ZipInfo("placeholder")
                info.filename = info.orig_filename = name  # the constructor changes separators
                info.compress_type = method
                name = info
            with pytest.warns(UserWarning, match="Duplicate name") if name.filename in archive.NameToInfo else _quiet():
                archive.writestr(name, content)
    return path


class _quiet:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def rules(path, limits=None):
    """Rules for which an archive is refused."""
    with pytest.raises(ArchiveError) as refused, Archive(path, *([limits] if limits else [])):
        pass
    return {rule for rule, _ in refused.value.problems}


def link(name, target="/etc/passwd", kind=stat.S_IFLNK):
    info = zipfile.ZipInfo(name)
    info.create_system = 3
    info.external_attr = (kind | 0o777) << 16
    return info, target


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("../evil.txt", "traversal"),
        ("resources/../../evil.txt", "traversal"),
        ("/elsewhere/evil.txt", "absolute"),
        ("//server/share", "absolute"),
        ("C:/evil.txt", "drive"),
        ("resources/data.txt:stream", "drive"),
        ("..\\evil.txt", "traversal"),
        ("\\evil.txt", "absolute"),
        ("resources\\..\\..\\evil.txt", "traversal"),
        ("resources\\NUL.txt", "reserved"),
        ("resources/./data.txt", "path"),
        ("resources//data.txt", "path"),
        ("", "path"),
        ("\0", "control"),
        ("resources/a\nb", "control"),
        ("resources/data.", "trailing"),
        ("resources/data ", "trailing"),
        ("resources/NUL.txt", "reserved"),
        ("resources/" + "n" * 300, "long"),
        ("a/" * 100 + "b", "deep"),
    ],
)
def test_names_that_leave_or_break_folders(name, rule, tmp_path):
    path = pack(tmp_path / "a.fmu", DESCRIPTION, (name, b"x"))
    assert rule in rules(path)
    target = tmp_path / "target"
    target.mkdir()
    with pytest.raises(ArchiveError):
        extract(path, target)
    assert list(target.iterdir()) == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.fmu", "target"]


def test_a_nul_in_a_name(tmp_path):
    """zipfile cuts names at a NUL, other readers do not: written into the bytes by hand."""
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/safe_txt", b"x"))
    path.write_bytes(path.read_bytes().replace(b"resources/safe_txt", b"resources/safe\0txt"))
    assert "control" in rules(path)


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK])
def test_links_and_special_files(kind, tmp_path):
    assert rules(pack(tmp_path / "a.fmu", DESCRIPTION, link("resources/link", kind=kind))) == {"link"}


@pytest.mark.parametrize(
    ("first", "second", "rule"),
    [
        ("modelDescription.xml", None, "duplicate"),
        ("resources/data.txt", "resources/Data.TXT", "case"),
        ("resources/straße", "resources/STRASSE", "case"),
        ("resources/\u00e9", "resources/e\u0301", "case"),
        ("resources/a", "resources/a/b", "duplicate"),
        ("resources/a", "resources\\a", "duplicate"),
        ("resources\\a", "resources/A", "case"),
    ],
)
def test_two_members_for_one_file(first, second, rule, tmp_path):
    assert rule in rules(pack(tmp_path / "a.fmu", DESCRIPTION, (first, b"1"), (second or first, b"2")))


def test_backslashes_are_said_and_read_as_folders(tmp_path):
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources\\data.txt", b"data"), ("resources\\empty\\", b""))
    target = tmp_path / "target"
    target.mkdir()
    extract(path, target)
    assert (target / "resources" / "data.txt").read_bytes() == b"data"
    assert (target / "resources" / "empty").is_dir()
    [finding] = [f for f in check_fmu(path, run=False).findings if f.group == "archive"]
    assert finding.rule == "archive.backslash"
    assert finding.severity is Severity.ERROR
    assert "and 1 more have a backslash" in finding.message


def test_equal_entries_that_are_there_twice_are_a_warning(tmp_path):
    twice = [("resources/", b""), ("resources/data.txt", b"data")] * 2
    path = pack(tmp_path / "a.fmu", DESCRIPTION, *twice)
    target = tmp_path / "target"
    target.mkdir()
    extract(path, target)
    assert (target / "resources" / "data.txt").read_bytes() == b"data"
    [finding] = [f for f in check_fmu(path, run=False).findings if f.group == "archive"]
    assert (finding.rule, finding.severity) == ("archive.duplicate", Severity.WARNING)
    assert rules(pack(tmp_path / "b.fmu", DESCRIPTION, *twice, ("resources/data.txt", b"DATA"))) == {"duplicate"}


def test_empty_folders_are_extracted(tmp_path):
    target = tmp_path / "target"
    target.mkdir()
    extract(pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/", b"")), target)
    assert (target / "resources").is_dir()


def test_bombs_by_ratio_and_by_size(tmp_path):
    zeros = b"\0" * (32 << 20)
    path = pack(tmp_path / "ratio.fmu", DESCRIPTION, ("resources/zeros", zeros))
    assert path.stat().st_size < 100_000
    assert rules(path) == {"ratio"}
    assert rules(path, ArchiveLimits(total_bytes=1 << 20)) == {"ratio", "size"}
    with Archive(path, ArchiveLimits(ratio=2000.0)) as archive:
        assert archive.size("resources/zeros") == len(zeros)


def test_members_that_share_bytes(tmp_path):
    """A second entry of the directory points at the first one's data: such parts add up."""
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/a", b"a" * 1000), ("resources/b", b"a" * 1000))
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        offset = archive.getinfo("resources/a").header_offset
    entry = content.rindex(b"PK\x01\x02")
    content[entry + 42 : entry + 46] = struct.pack("<I", offset)
    path.write_bytes(content)
    assert "overlap" in rules(path)


def test_an_announced_size_that_is_too_small_is_not_exceeded(tmp_path):
    """The directory says 10 bytes, the data give 32 MiB: reading stops at what was announced, and the sum is wrong."""
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/zeros", b"\0" * (32 << 20)))
    content = bytearray(path.read_bytes())
    entry = content.rindex(b"PK\x01\x02")
    content[entry + 24 : entry + 28] = struct.pack("<I", 10)
    path.write_bytes(content)
    target = tmp_path / "target"
    target.mkdir()
    with pytest.raises(ArchiveError, match="damaged"):
        extract(path, target)
    assert sum(file.stat().st_size for file in target.rglob("*") if file.is_file()) < 1 << 20


def test_too_many_entries(tmp_path):
    path = pack(tmp_path / "a.fmu", DESCRIPTION, *((f"resources/{n}", b"") for n in range(50)))
    assert rules(path, ArchiveLimits(entries=20)) == {"entries"}


def test_encryption_and_foreign_compression(tmp_path):
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/secret", b"x"))
    content = bytearray(path.read_bytes())
    content[content.rindex(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(content)
    assert rules(path) == {"encrypted"}
    assert rules(pack(tmp_path / "b.fmu", DESCRIPTION, method=zipfile.ZIP_LZMA)) == {"compression"}


def test_nested_archives_stay_closed(tmp_path):
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", b"\0" * (64 << 20))
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/inner.zip", inner.getvalue()))
    target = tmp_path / "target"
    target.mkdir()
    extract(path, target)
    assert (target / "resources" / "inner.zip").read_bytes() == inner.getvalue()
    assert "archive.nested" in {finding.rule for finding in check_fmu(path, run=False).findings}


@pytest.mark.parametrize(
    "content", [b"", b"nothing", b"PK\x03\x04", b"PK\x05\x06" + bytes(18), zlib.compress(b"x" * 99)]
)
def test_what_is_no_archive(content, tmp_path):
    path = tmp_path / "a.fmu"
    path.write_bytes(content)
    report = check_fmu(path)
    assert not report.ok
    assert {finding.rule for finding in report.findings} <= {"archive.zip", "archive.description"}


def test_extraction_gives_the_bytes_and_overwrites_nothing(tmp_path):
    path = pack(tmp_path / "a.fmu", DESCRIPTION, ("resources/deep/data.bin", bytes(range(256)) * 9000))
    target = tmp_path / "target"
    target.mkdir()
    assert extract(path, target) == target
    assert (target / "resources/deep/data.bin").read_bytes() == bytes(range(256)) * 9000
    with pytest.raises(FileExistsError):
        extract(path, target)


def test_many_long_names_are_judged_fast(tmp_path):
    """Time grows with the size of the directory, not with its square."""
    path = pack(tmp_path / "a.fmu", DESCRIPTION, *((f"{'d/' * 60}{n}", b"") for n in range(5000)))
    began = time.monotonic()
    with Archive(path):
        pass
    assert time.monotonic() - began < 30.0  # a second here; squared growth would take minutes
