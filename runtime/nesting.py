"""Limits on the nesting depth and number length of TOML and JSON texts, checked before their parsers run.

The parsers recurse at every level, and convert digits to numbers in quadratic time. Both scans here are linear.
"""

import re

# Nested lists and tables, and parts of a dotted key. TOML's parsing time grows with both.
DEEPEST_TOML = 10
DEEPEST_JSON = 64
# Digits of a number: one fewer than the patterns look for. Python itself refuses to write more than 4,300.
LONGEST_NUMBER = 1000

# Every quantifier is possessive: an unclosed text is scanned once, not tried again from every quote in it.
_TOML = re.compile(
    r"""\#[^\n]*+|\"\"\"(?:[^"\\]++|\\.|"(?!""))*+(?:\"\"\")?+|'''(?:[^']++|'(?!''))*+(?:''')?+
    |"(?:[^"\\\n]++|\\.)*+"?+|'[^'\n]*+'?+|(?P<mark>[][{}=,.\n])|(?P<long>(?<![\w+-])[\w+-]{1001})""",
    re.VERBOSE | re.DOTALL,
)
_JSON = re.compile(rb'"(?:[^"\\]++|\\.)*+"?+|(?P<mark>[][{}])|(?P<long>(?<![0-9])[0-9]{1001})', re.DOTALL)


def check_toml(text: str) -> None:
    """Raise ValueError if `text` nests deeper than DEEPEST_TOML or holds a number longer than LONGEST_NUMBER."""
    depth = dots = 0
    for found in _TOML.finditer(text):
        mark = found["mark"]
        if mark == ".":
            dots += 1
        elif mark is not None:
            dots = 0
            depth += (mark in "[{") - (mark in "]}")
        elif found["long"] is not None:
            raise ValueError(f"a key or a number is longer than {LONGEST_NUMBER} digits")
        if depth > DEEPEST_TOML or dots > DEEPEST_TOML:
            raise ValueError(f"lists, tables or dotted keys nest deeper than {DEEPEST_TOML} levels")


def check_json(data: bytes) -> None:
    """Raise ValueError if `data` nests deeper than DEEPEST_JSON or holds a number longer than LONGEST_NUMBER."""
    depth = 0
    for found in _JSON.finditer(data):
        mark = found["mark"]
        if mark is not None:
            depth += 1 if mark in b"[{" else -1
            if depth > DEEPEST_JSON:
                raise ValueError(f"lists and objects nest deeper than {DEEPEST_JSON} levels")
        elif found["long"] is not None:
            raise ValueError(f"a number is longer than {LONGEST_NUMBER} digits")
