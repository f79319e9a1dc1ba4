"""A strict little reader of ISO 10303-21 text, independent of the writer and of any kernel."""

import re
from dataclasses import dataclass

TOKEN = re.compile(
    r"(?P<space>\s+)"
    r"|(?P<string>'(?:[^'\n]|'')*')"
    r"|(?P<real>[+-]?\d+\.\d*(?:E[+-]?\d+)?)(?![\w.])"
    r"|(?P<integer>[+-]?\d+)(?![\w.])"
    r"|(?P<ref>#\d+)"
    r"|(?P<enum>\.[A-Z_][A-Z0-9_]*\.)"
    r"|(?P<word>[A-Z][A-Z0-9_]*)"
    r"|(?P<mark>[()=;,$*])"
)


@dataclass(frozen=True)
class Name:
    """A reference to an entity."""

    id: int


@dataclass(frozen=True)
class Typed:
    """A typed parameter or one entity of a complex instance."""

    kind: str
    args: tuple


def decode(literal):
    """Decode a Part-21 string literal."""
    text = literal[1:-1].replace("''", "'")

    def wide(match):
        width = 4 if match[1] == "2" else 8
        digits = match[2]
        return "".join(chr(int(digits[k : k + width], 16)) for k in range(0, len(digits), width))

    parts = re.split(r"(\\\\|\\X[24]\\[0-9A-F]+\\X0\\)", text)
    out = []
    for part in parts:
        escape = re.fullmatch(r"\\X([24])\\([0-9A-F]+)\\X0\\", part)
        if escape:
            out.append(wide(escape))
        else:
            assert part == "\\\\" or "\\" not in part, f"stray backslash in {literal}"
            out.append("\\" if part == "\\\\" else part)
    return "".join(out)


def tokens(text):
    """Yield (kind, text); anything outside the grammar fails."""
    place = 0
    while place < len(text):
        match = TOKEN.match(text, place)
        assert match, f"not Part 21: {text[place : place + 60]!r}"
        place = match.end()
        if match.lastgroup != "space":
            yield match.lastgroup, match.group()


class Reader:
    """Recursive descent over a token list."""

    def __init__(self, text):
        self.items = list(tokens(text))
        self.at = 0

    def next(self, expected=None):
        kind, text = self.items[self.at]
        assert expected is None or text == expected, f"expected {expected}, found {text}"
        self.at += 1
        return kind, text

    def peek(self):
        return self.items[self.at][1]

    def arguments(self):
        self.next("(")
        out = []
        while self.peek() != ")":
            if out:
                self.next(",")
            out.append(self.value())
        self.next(")")
        return tuple(out)

    def value(self):
        kind, text = self.items[self.at]
        if text == "(":
            return self.arguments()
        self.at += 1
        if kind == "string":
            return decode(text)
        if kind == "real":
            return float(text)
        if kind == "integer":
            return int(text)
        if kind == "ref":
            return Name(int(text[1:]))
        if kind == "word":
            return Typed(text, self.arguments())
        assert kind == "enum" or text in "$*", f"unexpected {text}"
        return text

    def instance(self):
        kind, text = self.next()
        assert kind == "ref", f"expected an instance, found {text}"
        self.next("=")
        if self.peek() == "(":
            self.next("(")
            parts = []
            while self.peek() != ")":
                parts.append(self.value())
            self.next(")")
            kinds = [part.kind for part in parts]
            assert kinds == sorted(kinds), "leaves of a complex entity stand in alphabetical order"
            result = Typed("+".join(kinds), tuple(part.args for part in parts))
        else:
            result = self.value()
        self.next(";")
        return int(text[1:]), result


def parse(text):
    """Return the header entities and ``{id: Typed}`` of an exchange file."""
    shape = r"ISO-10303-21;\nHEADER;\n(.*?)ENDSEC;\nDATA;\n(.*?)ENDSEC;\nEND-ISO-10303-21;\n"
    match = re.fullmatch(shape, text, re.DOTALL)
    assert match, "sections are missing"
    header, data = Reader(match[1]), Reader(match[2])
    heads = {}
    while header.at < len(header.items):
        entity = header.value()
        header.next(";")
        heads[entity.kind] = entity.args
    entities = {}
    while data.at < len(data.items):
        number, entity = data.instance()
        assert number not in entities, f"#{number} is defined twice"
        entities[number] = entity
    return heads, entities


def names_in(value):
    """Yield every reference inside a value."""
    if isinstance(value, Name):
        yield value.id
    elif isinstance(value, Typed):
        yield from names_in(value.args)
    elif isinstance(value, tuple):
        for item in value:
            yield from names_in(item)
