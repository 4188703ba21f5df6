#!/usr/bin/env python3
"""Figures of the house: lines of each room, long functions, public items.

    python3 scripts/house.py [REPOSITORY]

Lines are code, comments (documentation apart) and tests (`#[cfg(test)]` modules, files of tests); a
function's length is from its `fn` to its last brace. Circles are held by tests/architecture.
"""

import pathlib
import re
import sys

LONG = 80


def blank(text):
    """The text with every comment, string and character replaced by blanks, line by line."""
    out, i, n = [], 0, len(text)
    while i < n:
        raw = re.compile(r'(?:b|c)?r(#*)"').match(text, i)
        if text.startswith("//", i):
            end = text.find("\n", i)
            end = n if end < 0 else end
        elif text.startswith("/*", i):
            depth, end = 0, i
            while end < n:
                if text.startswith("/*", end):
                    depth, end = depth + 1, end + 2
                elif text.startswith("*/", end):
                    depth, end = depth - 1, end + 2
                    if depth == 0:
                        break
                else:
                    end += 1
        elif raw and (i == 0 or not (text[i - 1].isalnum() or text[i - 1] == "_")):
            close = '"' + raw.group(1)
            end = text.find(close, raw.end()) + len(close)
        elif text[i] == '"':
            end = i + 1
            while text[end] != '"':
                end += 2 if text[end] == "\\" else 1
            end += 1
        elif match := re.compile(r"'(?:\\(?:u\{[^}]*\}|x..|.)|[^'\\])'").match(text, i):
            end = match.end()
        else:
            out.append(text[i])
            i += 1
            continue
        out.append(re.sub(r"[^\n]", " ", text[i:end]))
        i = end
    return "".join(out)


def closing(code, at):
    """The index of the brace that closes the one at `at`."""
    depth = 0
    for i in range(at, len(code)):
        if code[i] == "{":
            depth += 1
        elif code[i] == "}":
            depth -= 1
            if depth == 0:
                return i
    return len(code) - 1


def test_lines(code):
    """The lines of `#[cfg(test)] mod x { ... }`."""
    inside = set()
    for match in re.finditer(r"#\[cfg\(test\)\]\s*(?:#\[[^\]]*\]\s*)*mod \w+ \{", code):
        last = closing(code, match.end() - 1)
        inside.update(range(code.count("\n", 0, match.start()), code.count("\n", 0, last) + 1))
    return inside


def functions(code):
    """(line, name, length) of every function with a body."""
    for match in re.finditer(r"\bfn (\w+)", code):
        at, depth = match.end(), 0
        while at < len(code):
            if code[at] in "([":
                depth += 1
            elif code[at] in ")]":
                depth -= 1
            elif depth == 0 and code[at] in "{;":
                break
            at += 1
        if at < len(code) and code[at] == "{":
            first = code.count("\n", 0, match.start())
            yield first, match.group(1), code.count("\n", 0, closing(code, at)) - first + 1


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)
    rooms, long, by_path = {}, [], 0
    for top in ("src", "tests"):
        for path in sorted((root / top).rglob("*.rs")):
            text = path.read_text()
            parts = path.relative_to(root).parts
            room = f"{top}/{parts[1].removesuffix('.rs')}"
            of_tests = top == "tests" and room not in ("tests/suite", "tests/support")
            of_tests = of_tests or "tests" in parts[2:] or path.stem.endswith("tests")
            code = blank(text)
            tests = test_lines(code)
            row = rooms.setdefault(room, dict.fromkeys(
                ("code", "docs", "comments", "tests", "public", "public here", "empty docs"), 0))
            lines = zip(text.split("\n"), code.split("\n"))
            for number, (line, bare) in enumerate(lines):
                line = line.strip()
                if not line:
                    continue
                if of_tests or number in tests:
                    row["tests"] += 1
                elif bare.strip():
                    row["code"] += 1
                elif line.startswith(("///", "//!")):
                    row["docs"] += 1
                    row["empty docs"] += len(line) <= 4 + 14
                else:
                    row["comments"] += 1
            by_path += len(re.findall(r"^\s*#\[path = ", text, re.M))
            if of_tests:
                continue
            item = r"(?:(?:const|async|unsafe) )*(?:fn|struct|enum|trait|const|static|type|mod|use) "
            for number, bare in enumerate(code.split("\n")):
                if number not in tests:
                    row["public"] += bool(re.match(r"\s*pub " + item, bare))
                    row["public here"] += bool(re.match(r"\s*pub\([^)]*\) " + item, bare))
            for number, name, length in functions(code):
                if length > LONG and number not in tests:
                    long.append((length, f"{'/'.join(parts)}:{number + 1}", name))
    names = ["code", "docs", "comments", "tests", "public", "public here", "empty docs"]
    print("| room | " + " | ".join(names) + " |\n|---" * 1 + "|---" * len(names) + "|")
    for room in sorted(rooms) + ["all"]:
        row = rooms.get(room) or {n: sum(r[n] for r in rooms.values()) for n in names}
        print(f"| {room} | " + " | ".join(str(row[name]) for name in names) + " |")
    print(f"\n{len(long)} functions over {LONG} lines outside tests:")
    for length, place, name in sorted(long, reverse=True):
        print(f"  {length} {name} ({place})")
    print(f"\n{by_path} files included by `#[path]`")


if __name__ == "__main__":
    main()
