"""XML that does harm: refused fast, by the rule that names it; what remains is held against the schemas."""

import subprocess
import sys
import zipfile

import pytest
from small_fmus import DESCRIPTIONS, SCHEDULED, members, write

from fmu.validate.check import check_fmu
from fmu.validate.reading.xml_file import XmlError, XmlLimits, as_utf8, parse, schema_findings

TEXT = DESCRIPTIONS[3]
LAUGHS = (
    "<!DOCTYPE z [<!ENTITY a0 'ha'>" + "".join(f"<!ENTITY a{n} '{f'&a{n - 1};' * 10}'>" for n in range(1, 10)) + "]>"
)


def refusal(content):
    with pytest.raises(XmlError) as refused:
        parse(content, "modelDescription.xml")
    assert refused.value.finding.message.startswith("modelDescription.xml")
    return refused.value.finding.rule.removeprefix("xml.")


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (f"{LAUGHS}<z>&a9;</z>".encode(), "doctype"),
        (b"<!DOCTYPE z SYSTEM 'file:///etc/passwd'><z/>", "doctype"),
        (b"<!DOCTYPE z [<!ENTITY e SYSTEM 'file:///etc/passwd'>]><z>&e;</z>", "doctype"),
        (b"<!DOCTYPE z><z/>", "doctype"),
        (
            b"<?xml version='1.0'?><!-- c --><!DOCTYPE z [<!ENTITY % p SYSTEM 'http://localhost:9/x'> %p;]><z/>",
            "doctype",
        ),
        (b"<z>&undefined;</z>", "syntax"),
        (b"<a>" * 10_000 + b"</a>" * 10_000, "depth"),
        (b"<z>\xff\xfe</z>", "encoding"),
        ("<?xml version='1.0' encoding='UTF-16'?><z/>".encode("utf-16"), "nul"),
        (b"<?xml version='1.0' encoding='ISO-8859-1'?><z/>", "encoding"),
        (b"<?xml version='1.0' encoding='UTF-7'?><z/>", "encoding"),
        (b"<z>\0</z>", "nul"),
        (b"", "syntax"),
        (b"<z>", "syntax"),
        (b"<z a='1' a='2'/>", "syntax"),
        (b"<z/><z/>", "syntax"),
        (b"text", "syntax"),
    ],
)
def test_harmful_and_broken_xml(content, rule):
    assert refusal(content) == rule


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("<?xml version='1.0' encoding='ISO-8859-1'?><z a='é'/>".encode("latin-1"), "ISO-8859-1"),
        ("<?xml version='1.0' encoding=\"windows-1252\"?><z a='é'/>".encode("cp1252"), "windows-1252"),
        ("<?xml version='1.0' encoding='UTF-16'?><z a='é'/>".encode("utf-16"), "UTF-16"),
        ("<?xml version='1.0' encoding='UTF-8'?><z a='é'/>".encode("latin-1"), "byte 44"),
        ("<z a='é'/>".encode("latin-1"), "byte 6"),
    ],
)
def test_other_codings_are_said_and_read(content, word):
    text, [finding] = as_utf8(content, "f")
    assert finding.rule == "xml.encoding"
    assert word in finding.message
    assert parse(text, "f").get("a") == "é"


@pytest.mark.parametrize("coding", ["UTF-7", "EBCDIC-CP-US", "rot13", "unicode_escape", "nonsense"])
def test_codings_that_hide_something_are_refused(coding):
    with pytest.raises(XmlError, match=f"its encoding is {coding}"):
        as_utf8(f"<?xml version='1.0' encoding='{coding}'?><z/>".encode(), "f")


def test_utf_8_passes_as_it_is():
    for content in (TEXT.encode(), b"\xef\xbb\xbf" + TEXT.encode(), b"<z/>", b""):
        assert as_utf8(content, "f") == (content, [])


def test_a_description_in_another_coding_is_checked_to_its_end(tmp_path):
    text = TEXT.replace("UTF-8", "ISO-8859-1").replace('modelName="Small"', 'modelName="Größe"')
    text = text.replace('name="margin"', 'name="1margin"')
    report = check_fmu(write(tmp_path / "a.fmu", {**members(3), "modelDescription.xml": text.encode("latin-1")}))
    assert [finding.rule for finding in report.findings] == ["xml.encoding", "variable.name"]
    assert report.fmi_version == "3.0"
    assert set(report.executed) == {"CoSimulation", "ModelExchange"}


def test_size_and_number_of_elements():
    assert refusal(b"<z>" + b" " * (65 << 20) + b"</z>") == "size"
    with pytest.raises(XmlError, match="more than 10 elements"):
        parse(b"<z>" + b"<a/>" * 10 + b"</z>", "f", XmlLimits(elements=10))


def test_a_hundred_megabytes_stay_below_a_memory_limit(tmp_path):
    """The check must neither read nor parse what is too large."""
    path = write(
        tmp_path / "big.fmu", {"modelDescription.xml": TEXT + "<!-- " + "ab " * (36 << 20) + "-->"}, zipfile.ZIP_STORED
    )
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30));"
        "from fmu.validate.check import check_fmu; r = check_fmu(sys.argv[1], run=False); print([f.rule for f "
        "in r.findings])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['xml.size']"


@pytest.mark.parametrize("prefix", [b"", b"\xef\xbb\xbf"])
def test_a_sound_description_passes(prefix):
    for text, schema in ((DESCRIPTIONS[2], "fmi2"), (DESCRIPTIONS[3], "fmi3"), (SCHEDULED, "fmi3")):
        root = parse(prefix + text.encode(), "modelDescription.xml")
        assert schema_findings(root, "f", f"{schema}/{schema}ModelDescription.xsd") == []


def test_places_that_do_not_fit_the_schema_have_their_line(tmp_path):
    text = TEXT.replace('causality="parameter"', 'causality="parametre"').replace("<Output ", "<Outputs ")
    report = check_fmu(write(tmp_path / "a.fmu", {**members(3), "modelDescription.xml": text}))
    found = [finding for finding in report.findings if finding.rule == "schema.valid"]
    assert any("'parametre'" in f.message and "line 12" in f.message for f in found)
    assert report.executed == ()


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (TEXT.replace('fmiVersion="3.0"', 'fmiVersion="1.0"'), "xml.version"),
        (TEXT.replace('fmiVersion="3.0"', ""), "xml.root"),
        ("<other fmiVersion='3.0'/>", "xml.root"),
    ],
)
def test_other_documents(text, rule, tmp_path):
    report = check_fmu(write(tmp_path / "a.fmu", {**members(3), "modelDescription.xml": text}))
    assert [finding.rule for finding in report.findings] == [rule]
    assert rule == "xml.root" or "FMI 1.0, which is not supported" in report.findings[0].message


@pytest.mark.parametrize(
    "name",
    ["sources/buildDescription.xml", "terminalsAndIcons/terminalsAndIcons.xml", "extra/org.x/fmi-ls-manifest.xml"],
)
def test_the_other_xml_files_are_held_to_the_same_rules(name, tmp_path):
    for content, rule in ((f"{LAUGHS}<z/>", "xml.doctype"), ("<wrong/>", "schema.valid")):
        report = check_fmu(write(tmp_path / "a.fmu", {**members(3), name: content}), run=False)
        expected = "layered.manifest" if rule == "schema.valid" and name.startswith("extra/") else rule
        assert expected in {finding.rule for finding in report.findings}


def test_schema_findings_agree_with_another_validator(tmp_path):
    """xmlschema, written in Python, is the oracle: both must take and refuse the same descriptions."""
    xmlschema = pytest.importorskip("xmlschema")
    import fmpy

    folder = f"{fmpy.__path__[0]}/schema"
    changes = [
        ("valueReference", "reference"),
        ('start="1"', 'start="one"'),
        ("ModelStructure>", "Structure>"),
        ("", ""),
    ]
    for major, text in DESCRIPTIONS.items():
        oracle = xmlschema.XMLSchema(f"{folder}/fmi{major}/fmi{major}ModelDescription.xsd")
        for old, new in changes:
            changed = text.replace(old, new) if old else text
            path = tmp_path / "modelDescription.xml"
            path.write_text(changed)
            ours = schema_findings(parse(changed.encode(), "f"), "f", f"fmi{major}/fmi{major}ModelDescription.xsd")
            assert (ours == []) is oracle.is_valid(str(path)) is (old == "")
