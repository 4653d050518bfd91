"""Archives and descriptions changed at random: each gives a report, never a traceback, in bounded time."""

import zipfile

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_fmus import DESCRIPTIONS, SCHEDULED, binary, members, write

from fmu.archives.reading import Archive, ArchiveError
from fmu.validate.check import check_fmu
from fmu.validate.findings import Report, Severity

FUZZ = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
TEXTS = (DESCRIPTIONS[2], DESCRIPTIONS[3], SCHEDULED)
WORDS = sorted({word for text in TEXTS for word in text.replace("/", " ").replace("<", " ").replace(">", " ").split()})
VALUES = [
    "",
    "-1",
    "0",
    "1e999",
    "NaN",
    "INF",
    "4294967295",
    "4294967296",
    "9" * 30,
    "true",
    "x",
    "der(x)",
    "\u00e9",
    "output",
    "tick",
]


def require_report(report):
    assert isinstance(report, Report)
    assert report.ok is all(finding.severity is not Severity.ERROR for finding in report.findings)
    assert all(finding.message.isprintable() for finding in report.findings)


@FUZZ
@given(
    changes=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 255), st.sampled_from(["set", "cut", "insert"])), max_size=12
    ),
    keep=st.floats(0.3, 1.0),
)
def test_bytes_of_an_archive(changes, keep, tmp_path):
    path = write(tmp_path / "a.fmu", members(3), zipfile.ZIP_DEFLATED)
    content = bytearray(path.read_bytes())
    # The directory at the end steers how all else is read: half of the changes fall there.
    for number, (place, value, how) in enumerate(changes):
        length = len(content) if number % 2 else min(len(content), 400)
        at = len(content) - 1 - int(place * (length - 1))
        if how == "set":
            content[at] = value
        elif how == "cut":
            del content[at]
        else:
            content.insert(at, value)
    path.write_bytes(content if keep > 0.9 else content[: int(keep * len(content))])
    require_report(check_fmu(path, run=False))


@FUZZ
@given(
    text=st.sampled_from(TEXTS),
    edits=st.lists(st.tuples(st.sampled_from(WORDS), st.sampled_from(WORDS + VALUES)), min_size=1, max_size=4),
)
def test_words_of_a_description(text, edits, tmp_path):
    for old, new in edits:
        text = text.replace(old, new, 1)
    require_report(check_fmu(write(tmp_path / "a.fmu", {"modelDescription.xml": text}), run=False))


@FUZZ
@given(data=st.data(), text=st.sampled_from(TEXTS))
def test_values_of_attributes(data, text, tmp_path):
    """Attributes keep their names: such descriptions fit the schema more often and reach the semantic rules."""
    pieces = text.split('"')
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(pieces) // 2 - 1)) * 2 + 1
        pieces[place] = data.draw(st.sampled_from(VALUES + pieces[1::2]))
    require_report(check_fmu(write(tmp_path / "a.fmu", {"modelDescription.xml": '"'.join(pieces)}), run=False))


@FUZZ
@given(names=st.lists(st.text(st.characters(exclude_categories=["Cs"]), max_size=12), max_size=4, unique=True))
def test_names_of_members(names, tmp_path):
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTIONS[3])
        for name in names:
            archive.writestr(zipfile.ZipInfo(name or "empty"), b"x")
    require_report(check_fmu(path, run=False))
    target = tmp_path / "target"
    target.mkdir(exist_ok=True)
    try:
        with Archive(path) as archive:
            files = archive.names
    except ArchiveError:
        return
    # What is accepted lies below the target, each file for itself.
    places = {(target / name).resolve() for name in files}
    assert all(target.resolve() in place.parents for place in places)
    assert len({str(place).casefold() for place in places}) == len(files)


@FUZZ
@given(
    kinds=st.sets(st.sampled_from(["sources/buildDescription.xml", "terminalsAndIcons/terminalsAndIcons.xml"])),
    content=st.binary(max_size=60),
)
def test_random_files_in_their_places(kinds, content, tmp_path):
    extra = {name: content for name in kinds} | {"binaries/x86_64-linux/small.so": binary(3)[:64] + content}
    require_report(check_fmu(write(tmp_path / "a.fmu", {"modelDescription.xml": DESCRIPTIONS[3], **extra}), run=False))
