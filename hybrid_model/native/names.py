"""Many names in little room: variables of large models share their beginnings (the part) and their ends (the variable).

A pointer to each name would take eight bytes, an entry for the loader of three times that, and the whole name. Here a
name is a pair of places in one text: that of its head, up to the last dot, and that of its tail.
"""

from __future__ import annotations

_LINE = 100


class NameTable:
    """The text that holds the heads and tails of names, each once and ended by a zero."""

    def __init__(self) -> None:
        self._places: dict[bytes, int] = {}
        self._text = bytearray()

    def pair(self, name: str) -> tuple[int, int]:
        """Return the places of a name's head (empty if it has no dot) and tail, and remember both."""
        head, dot, tail = name.rpartition(".")
        return self._place(head + dot), self._place(tail)

    def entry(self, name: str) -> str:
        """Return a C initialiser of a name: ``{head, tail}``."""
        return "{{{}, {}}}".format(*self.pair(name))

    @property
    def size(self) -> int:
        """Length of the text in bytes."""
        return len(self._text)

    def name(self, head: int, tail: int) -> str:
        """Return the name of a pair of places."""
        return (self._end(head) + self._end(tail)).decode("utf-8")

    def definition(self, identifier: str) -> str:
        """Return a C definition of the text as an array of char, in plain ASCII."""
        # Not a string literal: compilers limit their length. Character constants fit whether char has a sign or not.
        octets = [str(byte) if byte < 128 else f"'\\{byte:03o}'" for byte in self._text] or ["0"]
        lines, line = [], ""
        for octet in octets:
            if len(line) + len(octet) + 1 > _LINE:
                lines.append(line)
                line = ""
            line += f"{octet},"
        body = "\n    ".join([*lines, line])
        return f"static const char {identifier}[] = {{\n    {body}\n}};\n"

    def _place(self, part: str) -> int:
        octets = part.encode("utf-8")
        if octets not in self._places:
            self._places[octets] = len(self._text)
            self._text += octets + b"\0"
        return self._places[octets]

    def _end(self, place: int) -> bytes:
        return bytes(self._text[place : self._text.index(0, place)])
