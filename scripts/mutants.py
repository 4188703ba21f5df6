#!/usr/bin/env python3
"""Changes the numeric rooms in small ways and asks whether a test notices.

    cargo install --locked cargo-mutants@27.1.0
    pip install tree-sitter==0.26.1 tree-sitter-rust==0.24.2
    python3 scripts/mutants.py                  # the sample again, with the table
    python3 scripts/mutants.py --survivors      # only those in mutants_survivors.csv

`cargo mutants --list` names every mutant. A sample of each room, drawn with a fixed seed and
spread evenly over its files, is planted into a copy of the workspace, all at once, each behind a switch
that an environment variable turns. So one build serves all: rebuilding the library for each would
take minutes a mutant. An operator changes where it stands in the syntax tree, hence `a - b * c`
becomes `a - (b + c)`. Each mutant meets the tests that reach it, the quickest first, until one fails;
a limit on processor time, not on the clock, tells one that never ends.

Asked are the rooms' own tests: those of commands and bundles may catch what is listed here as surviving.
"""

import argparse
import collections
import concurrent.futures
import csv
import json
import os
import pathlib
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import threading

import tree_sitter
import tree_sitter_rust

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROOMS = ["numerics", "field", "coil", "lambda", "shape"]
TABLE = ROOT / "results/bench/mutants.csv"
SURVIVORS = ROOT / "results/bench/mutants_survivors.csv"
# A test that takes longer than this is asked only by the whole suite, seconds of processor time.
LONGEST_S = 10.0

SWITCH = """//! Which planted mutant is on.
#![allow(missing_docs)]
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
const UNREAD: u32 = u32::MAX;
const RECORD: u32 = u32::MAX - 1;
static MODE: AtomicU32 = AtomicU32::new(UNREAD);
static SEEN: [AtomicBool; 65536] = [const { AtomicBool::new(false) }; 65536];
#[inline(always)]
pub fn on(id: u32) -> bool {
    let mode = MODE.load(Relaxed);
    if mode >= RECORD { slow(id) } else { mode == id }
}
#[cold]
fn slow(id: u32) -> bool {
    if MODE.load(Relaxed) == UNREAD {
        let mode = if std::env::var_os("MUTANT_REACHED").is_some() { RECORD } else {
            std::env::var("MUTANT").ok().and_then(|m| m.parse().ok()).unwrap_or(0)
        };
        MODE.store(mode, Relaxed);
    }
    if MODE.load(Relaxed) != RECORD { return MODE.load(Relaxed) == id; }
    if !SEEN[id as usize].swap(true, Relaxed) {
        let path = std::env::var_os("MUTANT_REACHED").unwrap();
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(path).unwrap();
        file.write_all(format!("{id}\\n").as_bytes()).unwrap();
    }
    false
}
"""


def listed(room):
    """Every mutant of a room, with a name that outlives shifted lines: words and how many alike precede."""
    text = subprocess.run(["cargo", "mutants", "--list", "--json", "--package", f"fluxform-{room}"],
                          cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout
    alike = collections.Counter()
    mutants = []
    for raw in json.loads(text):
        words = raw["name"].split(": ", 1)[1]
        alike[raw["file"], words] += 1
        mutants.append({"room": room, "file": raw["file"], "words": words,
                        "nth": alike[raw["file"], words], "line": raw["span"]["start"]["line"],
                        "genre": raw["genre"], "replacement": raw["replacement"], "span": raw["span"]})
    return mutants


def key(mutant):
    return mutant["file"], mutant["words"], int(mutant["nth"])


def sample(mutants, count, seed):
    """Every n-th of the mutants, file after file, from a start and in an order within files by chance."""
    chance = random.Random(f"{seed}:{mutants[0]['room']}")
    files = collections.defaultdict(list)
    for mutant in mutants:
        files[mutant["file"]].append(mutant)
    row = []
    for name in sorted(files):
        chance.shuffle(files[name])
        row += files[name]
    count = min(count, len(row))
    start = chance.random()
    return [row[int((start + i) * len(row) / count)] for i in range(count)]


class Planter:
    """Plants mutants into one file's text."""

    def __init__(self, text):
        self.text = text
        self.data = text.encode()
        self.lines = [0]
        for line in text.splitlines(keepends=True):
            self.lines.append(self.lines[-1] + len(line.encode()))
        language = tree_sitter.Language(tree_sitter_rust.language())
        self.tree = tree_sitter.Parser(language).parse(self.data)
        self.swaps = collections.defaultdict(list)  # (start, end) -> [(id, text instead)]
        self.inserts = collections.defaultdict(str)  # where -> text

    def offset(self, place):
        line = self.text.splitlines(keepends=True)[place["line"] - 1]
        return self.lines[place["line"] - 1] + len(line[: place["column"] - 1].encode())

    def cut(self, node):
        return self.data[node.start_byte:node.end_byte].decode()

    def climb(self, start, end, kinds):
        node = self.tree.root_node.descendant_for_byte_range(start, end)
        while node is not None and node.type not in kinds:
            node = node.parent
        return node

    def swap(self, node, number, instead):
        self.swaps[node.start_byte, node.end_byte].append((number, instead))

    def plant(self, mutant, number):
        """True when the mutant has its place."""
        start, end = self.offset(mutant["span"]["start"]), self.offset(mutant["span"]["end"])
        genre, new = mutant["genre"], mutant["replacement"]
        if genre == "BinaryOperator":
            node = self.climb(start, end, ("binary_expression", "compound_assignment_expr"))
            if node is None:
                return False
            left, right = self.cut(node.child_by_field_name("left")), self.cut(node.child_by_field_name("right"))
            if node.type == "binary_expression":
                left = f"({left})"
            self.swap(node, number, f"{left} {new} ({right})")
        elif genre == "UnaryOperator":
            node = self.climb(start, end, ("unary_expression",))
            if node is None:
                return False
            self.swap(node, number, self.cut(node)[1:])
        elif genre == "FnValue":
            node = self.climb(start, end, ("function_item",))
            if node is None:
                return False
            body = node.child_by_field_name("body").start_byte + 1
            self.inserts[body] += f" if crate::planted::on({number}) {{ /*m{number}*/ return {new}; /*e{number}*/ }} "
        elif genre in ("MatchArm", "MatchArmGuard"):
            arm = self.climb(start, end, ("match_arm",))
            pattern = arm and arm.child_by_field_name("pattern")
            if pattern is None:
                return False
            guard = pattern.child_by_field_name("condition")
            if genre == "MatchArmGuard":
                self.swap(guard, number, new)
            elif guard is not None:
                self.swap(guard, number, "false")
            else:
                self.inserts[pattern.end_byte] += f" if !crate::planted::on({number}) "
        elif genre == "StructField":
            field = self.climb(start, end, ("field_initializer",))
            whole = field and self.climb(start, end, ("struct_expression",))
            base = whole and [c for c in whole.child_by_field_name("body").children
                              if c.type == "base_field_initializer"]
            if not base:
                return False
            name, kind = self.cut(field.child_by_field_name("field")), self.cut(whole.child_by_field_name("name"))
            self.swap(field.child_by_field_name("value"), number,
                      f"let s: {kind} = {self.cut(base[0])[2:]}; s.{name}")
        else:
            return False
        return True

    def render(self):
        return self._render(0, len(self.data), None)

    def _render(self, start, end, within):
        inside = sorted((s, -e) for s, e in self.swaps if start <= s and e <= end and (s, e) != within)
        out, at = [], start
        for s, e in [(s, -e) for s, e in inside]:
            if s < at:
                continue
            out.append(self._plain(at, s))
            arms = "".join(f"if crate::planted::on({n}) {{ /*m{n}*/ {t} /*e{n}*/ }} else "
                           for n, t in self.swaps[s, e])
            out.append(f"({arms}{{ {self._render(s, e, (s, e))} }})")
            at = e
        out.append(self._plain(at, end))
        return "".join(out)

    def _plain(self, start, end):
        out, at = [], start
        for place in sorted(p for p in self.inserts if start < p <= end):
            out += [self.data[at:place].decode(), self.inserts[place]]
            at = place
        return "".join(out) + self.data[at:end].decode()


def copied(work):
    """The workspace, with the switch in every room."""
    tree = work / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    names = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True,
                           stdout=subprocess.PIPE, text=True).stdout.split("\n")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    for room in ROOMS:
        folder = tree / "src" / room
        (folder / "planted.rs").write_text(SWITCH)
        with (folder / "lib.rs").open("a") as library:
            library.write("\npub mod planted;\n")
    return tree


def write_planted(tree, numbered, out):
    """Plants all but those marked as out."""
    files = collections.defaultdict(list)
    for number, mutant in numbered.items():
        if number not in out:
            files[mutant["file"]].append((number, mutant))
    touched = {m["file"] for m in numbered.values()}
    for name in touched:
        planter = Planter((ROOT / name).read_text())
        for number, mutant in files[name]:
            if not planter.plant(mutant, number):
                out[number] = "not planted"
        text = planter.render()
        if (tree / name).read_text() != text:
            (tree / name).write_text(text)


def cargo(tree, *arguments):
    environment = dict(os.environ, CARGO_PROFILE_DEV_DEBUG="0", CARGO_TARGET_DIR=str(tree.parent / "target"))
    rooms = [f"--package=fluxform-{room}" for room in ROOMS]
    run = subprocess.run(["cargo", *arguments, *rooms, "--locked", "--message-format=json"], cwd=tree,
                         env=environment, stdout=subprocess.PIPE, text=True)
    return run.returncode, [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]


def planted_without_errors(tree, numbered):
    """Takes back what does not compile, until all does. What was taken back, and why."""
    out = {}
    while True:
        write_planted(tree, numbered, out)
        code, messages = cargo(tree, "check")
        if code == 0:
            return out
        before = len(out)
        for message in messages:
            report = message.get("message", {})
            if message["reason"] != "compiler-message" or report.get("level") != "error":
                continue
            found = set()
            for span in sorted(report["spans"], key=lambda s: not s["is_primary"]):
                data = (tree / span["file_name"]).read_bytes() if (tree / span["file_name"]).exists() else b""
                head = data[: span["byte_start"]]
                opened = re.findall(rb"/\*([me])(\d+)\*/", head)
                cut = data[span["byte_start"]:span["byte_end"]]
                if opened and opened[-1][0] == b"m":
                    found.add((int(opened[-1][1]), "unviable"))
                elif (report.get("code") or {}).get("code") in ("E0015", "E0658", "E0133"):
                    found |= {(int(n), "not planted") for n in re.findall(rb"planted::on\((\d+)\)", cut)}
                else:
                    found |= {(int(n), "unviable") for n in re.findall(rb"/\*m(\d+)\*/", cut)}
                if found:
                    break
            if not found:
                for span in report["spans"]:
                    data = (tree / span["file_name"]).read_bytes().splitlines()
                    rows = data[span["line_start"] - 1:span["line_end"]]
                    found |= {(int(n), "not planted") for n in re.findall(rb"planted::on\((\d+)\)", b"\n".join(rows))}
            for number, why in found:
                out.setdefault(number, why)
        print(f"  {len(out)} do not compile", file=sys.stderr)
        if len(out) == before:
            sys.exit("the planted tree does not compile:\n" + "\n".join(
                m["message"]["rendered"] for m in messages if m["reason"] == "compiler-message")[:4000])


def built(work, numbered):
    """What could not be planted, and the rooms' test programs with the folders they run in."""
    tree = copied(work)
    out = planted_without_errors(tree, numbered)
    code, messages = cargo(tree, "test", "--no-run")
    if code != 0:
        sys.exit("\n".join(m["message"]["rendered"] for m in messages if m["reason"] == "compiler-message")[:4000])
    return out, [(m["executable"], pathlib.Path(m["manifest_path"]).parent) for m in messages
                 if m["reason"] == "compiler-artifact" and m.get("executable")]


def limited(seconds):
    def limit():
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 2))
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
    return limit


def run(test, seconds, **variables):
    """Exit code and processor time of one test by itself."""
    program, folder, name = test
    environment = dict(os.environ, RAYON_NUM_THREADS="1", RUST_BACKTRACE="0", CARGO_MANIFEST_DIR=str(folder), **variables)
    process = subprocess.Popen([program, "--exact", name, "--test-threads=1", "-q"], cwd=folder, env=environment,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=limited(seconds))
    watch = threading.Timer(20 * seconds + 60, process.kill)
    watch.start()
    _, status, used = os.wait4(process.pid, 0)
    watch.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, used.ru_utime + used.ru_stime


def reached(programs, jobs):
    """For each mutant, the tests that reach it, the quickest first."""
    tests = []
    for program, folder in programs:
        def names(*which):
            text = subprocess.run([program, "--list", *which], cwd=folder, check=True, stdout=subprocess.PIPE, text=True)
            return {line[:-6] for line in text.stdout.splitlines() if line.endswith(": test")}
        tests += [(program, folder, name) for name in sorted(names() - names("--ignored"))]

    def ask(test):
        with tempfile.NamedTemporaryFile("r") as file:
            code, seconds = run(test, LONGEST_S, MUTANT_REACHED=file.name)
            return test, code, seconds, {int(n) for n in file.read().split()}

    found = collections.defaultdict(list)
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for test, code, seconds, numbers in pool.map(ask, tests):
            if code != 0 or seconds >= LONGEST_S:
                print(f"  not asked: {os.path.basename(test[0])} {test[2]} (exit {code}, {seconds:.0f} s)", file=sys.stderr)
                continue
            for number in numbers:
                found[number].append((seconds, test))
    print(f"  {len(tests)} tests", file=sys.stderr)
    return {number: sorted(tests) for number, tests in found.items()}


def judge(number, tests):
    """What became of a mutant, and the test that caught it."""
    for seconds, test in tests:
        code, _ = run(test, 5 + 5 * seconds, MUTANT=str(number))
        if code in (-24, -9):
            return "timeout", test[2]
        if code != 0:
            return "caught", test[2]
    return ("survived", f"{len(tests)} tests reach it") if tests else ("survived", "no test reaches it")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rooms", nargs="+", default=ROOMS, choices=ROOMS)
    parser.add_argument("--count", type=int, default=100, help="mutants drawn in each room [100]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/mutants")
    parser.add_argument("--survivors", action="store_true", help="run those of the survivors' table again")
    parser.add_argument("--list", action="store_true", help="print the sample and stop")
    options = parser.parse_args()

    old = list(csv.DictReader(SURVIVORS.open())) if SURVIVORS.exists() else []
    wanted = {key(row) for row in old}
    whole = {room: listed(room) for room in options.rooms}
    drawn = []
    for room, mutants in whole.items():
        drawn += [m for m in mutants if key(m) in wanted] if options.survivors else sample(mutants, options.count, options.seed)
    numbered = dict(enumerate(drawn, 1))
    if options.list:
        for mutant in drawn:
            print(f"{mutant['file']}:{mutant['line']}: {mutant['words']}")
        return
    work = options.work.resolve()
    out, programs = built(work, numbered)
    reach = reached(programs, options.jobs)
    verdicts = {number: (why, "") for number, why in out.items()}
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        rest = [n for n in numbered if n not in out]
        for number, verdict in zip(rest, pool.map(lambda n: judge(n, reach.get(n, [])), rest)):
            verdicts[number] = verdict
            mutant = numbered[number]
            print(f"{mutant['room']:8} {verdict[0]:9} {mutant['file']}:{mutant['line']}: {mutant['words']} [{verdict[1]}]", flush=True)

    if options.survivors:
        now = {key(numbered[n]): verdicts[n] for n in numbered}
        for row in old:
            verdict, by = now.get(key(row), ("gone", ""))
            if verdict in ("caught", "timeout"):
                row["now"], row["why"] = "killed", by
            elif verdict == "gone" and row["room"] in options.rooms:
                row["now"] = "gone"
            elif row["now"] != "equivalent":
                row["now"] = "open"
    else:
        # Old rows of the rooms that are not asked stay.
        old = [row for row in old if row["room"] not in options.rooms]
        for number, mutant in numbered.items():
            if verdicts[number][0] == "survived":
                old.append({**{k: mutant[k] for k in ("room", "file", "line", "words", "nth")},
                            "now": "open", "why": verdicts[number][1]})
    with SURVIVORS.open("w", newline="") as file:
        writer = csv.DictWriter(file, ["room", "file", "line", "words", "nth", "now", "why"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(old)

    rows = {row["room"]: row for row in csv.DictReader(TABLE.open())} if TABLE.exists() else {}
    for room in options.rooms:
        if not options.survivors:
            count = collections.Counter(verdicts[n][0] for n, m in numbered.items() if m["room"] == room)
            rows[room] = {"room": room, "mutants": len(whole[room]), "sampled": sum(count.values()),
                          "unviable": count["unviable"], "not_planted": count["not planted"],
                          "caught": count["caught"], "timeout": count["timeout"], "survived_before": count["survived"]}
        now = collections.Counter(row["now"] for row in old if row["room"] == room)
        rows[room].update(killed_since=now["killed"] + now["gone"], equivalent=now["equivalent"], open=now["open"])
    with TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[options.rooms[0]]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[room] for room in ROOMS if room in rows)
    print(TABLE.read_text(), file=sys.stderr)


if __name__ == "__main__":
    main()
