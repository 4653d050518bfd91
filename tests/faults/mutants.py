"""The faults of mutants.txt, each with the place in the C files that it changes: there must be just one."""

import functools
import re
from dataclasses import dataclass
from pathlib import Path

from fmu.build.binaries import own_files

_ENTRY = re.compile(r"^(.+) \| (.+) \| (.+)\n@ (.+)\n- (.+)\n\+ ?(.*)$", re.MULTILINE)
_BETWEEN = r"(?:\s|/\*.*?\*/)*"
_WORDS = re.compile(r'"(?:\\.|[^"\\])*"|\w+|\S')
_DEFINITIONS = (
    re.compile(r"^(?:static )?(?:const )?[\w ]+?[ *]+(\w+)\([^;{}]*\)\s*\{.*?^\}", re.MULTILINE | re.DOTALL),
    re.compile(r"^static const [\w ]+ \*?(?:const )?(\w+)(?:\[[^\]]*\])+ = \{.*?\};", re.MULTILINE | re.DOTALL),
)


@dataclass(frozen=True)
class Mutant:
    """In the definition of `at`, `old` becomes `new`; `breaks` is the rule or fault that it stands for."""

    name: str
    at: str
    old: str
    new: str
    breaks: str
    first: str

    def places(self):
        """The file and the span of each place where `old` is."""
        pattern = re.compile(_BETWEEN.join(map(re.escape, _WORDS.findall(self.old))), re.DOTALL)
        for file, text, begin, end in _definitions().get(self.at, ()):
            yield from ((file, text, *found.span()) for found in pattern.finditer(text, begin, end))

    def changed(self):
        """The name of the one file that it is in, and the text that it makes of it."""
        places = list(self.places())
        assert len(places) == 1, f"{self.name}: {len(places)} places in {self.at} have {self.old!r}; there must be one"
        file, text, begin, end = places[0]
        return file, text[:begin] + self.new + text[end:]


@functools.cache
def _definitions():
    found = {}
    for path in own_files("*.c"):
        text = path.read_text()
        for pattern in _DEFINITIONS:
            for item in pattern.finditer(text):
                found.setdefault(item[1], []).append((path.name, text, *item.span()))
    return found


def read(text):
    """The mutants of a table."""
    found = _ENTRY.findall(text)
    assert len(found) == text.count("\n@ "), "an entry has four lines: what it is, @, - and +"
    return [Mutant(name, at, old, new, breaks, first) for name, breaks, first, at, old, new in found]


MUTANTS = read(Path(__file__).with_name("mutants.txt").read_text())
