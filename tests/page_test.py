#!/usr/bin/env python3
"""Runs the commands that pages show, and compares what they quote with what is printed.

    tests/page_test.py GRAYBOX SOURCE PAGE...       each page in a folder of its own
    tests/page_test.py GRAYBOX SOURCE --long        lists fences marked `long`: at most 15 in all pages, and none
                                                    the first of its page but for those of BEGINS_LONG

A fence whose first line is a command is run; a fence without a language after it is compared, line by
line, with all that the page's commands have printed: words are the same, numbers nearly. "[...]" stands
for lines, or a part of a line, left out. In a fence with "$ " before its commands the other lines are
their output; where that is a refusal, the last of them fails. Marks, on lines of their own before a fence:

    ```long                      the commands take long: only their options are looked at
    ```sh                        other programs' commands: neither run nor compared
    ```text                      what is printed elsewhere, with recordings that a page has not
    <!-- before: COMMAND -->     run first, for files that a reader has already
    <!-- file: NAME -->          the next fence is that file
    <!-- recordings: SET -->     the next fence reads the published recordings SET: run where
                                 GRAYBOX_RECORDINGS names their folder, else taken as `long`

Fences of Python are run, too, but for those that import graybox.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
MARK = re.compile(r"<!-- (before|file|recordings): (.*?) -->", re.DOTALL)
COMMAND = re.compile(r"(\$ )?(graybox |scripts/|cd |cat |curl |head |python3 |mkdir |export |\("
                     r"|[A-Za-z]+=)")
SHOWN = re.compile(r"^(\$ )?(graybox |scripts/[a-z])", re.MULTILINE)  # is a command wherever it stands
NUMBER = re.compile(r"\d+\.?\d*(?:[eE][-+]?\d+)?")
LEFT_OUT = "[...]"
MOST_LONG, TOLERANCE, ROUNDING = 15, 0.05, 1e-7
BEGINS_LONG = {  # pages whose first commands take minutes, and why
    "README.md": "builds graybox",
    "docs/explanation/challenge.md": "a rate needs many cases",
    "docs/explanation/challenge_any_motion.md": "a rate needs many cases"}
COPIED = ["docs/examples", "docs/reference/schemas", "problems/robot", "diagnosis/models",
          "diagnosis/campaigns"]
WRAPPER = """#!/bin/bash
# An answer `unknown` is one that a page may show.
printed="$(mktemp)"
"$GRAYBOX_OF_TEST" "$@" > "$printed"
code=$?
cat "$printed"
grep -q 'verdict"*: *"*unknown' "$printed" && [[ $code == 1 ]] && code=0
rm "$printed"
exit $code
"""


class Fence:
    def __init__(self, text, match, marks):
        self.language, self.body = match.group(1).strip(), match.group(2)
        self.line = text.count("\n", 0, match.start()) + 1
        self.before = [value for kind, value in marks if kind == "before"]
        self.file = next((value for kind, value in marks if kind == "file"), None)
        self.recordings = next((value for kind, value in marks if kind == "recordings"), None)
        first = self.body.lstrip("\n").split("\n", 1)[0]
        self.is_command = self.language in ("", "long") and COMMAND.match(first) is not None
        folder = os.environ.get("GRAYBOX_RECORDINGS")
        is_there = self.recordings and folder and (Path(folder) / self.recordings).is_dir()
        self.is_run = self.is_command and self.language != "long" and (
            self.recordings is None or bool(is_there))

    def split(self):
        """Commands, and the output that is quoted among them."""
        if not self.body.lstrip("\n").startswith("$ "):
            return self.body, []
        commands, quoted, goes_on = [], [], False
        for line in self.body.splitlines():
            if line.startswith("$ ") or goes_on:
                commands.append(line[2:] if line.startswith("$ ") else line)
                goes_on = line.endswith("\\")
            else:
                quoted.append(line)
        return "\n".join(commands) + "\n", quoted


def fences(page):
    text = page.read_text(encoding="utf-8")
    at = 0
    for match in FENCE.finditer(text):
        yield Fence(text, match, MARK.findall(text[at:match.start()]))
        at = match.end()


def is_near(quoted, printed):
    quoted, printed = float(quoted), float(printed)
    size = max(abs(quoted), abs(printed))
    return abs(quoted - printed) <= TOLERANCE * size or size < ROUNDING


def pattern_of(quoted):
    """A quoted line's words, with a group for each of its numbers."""
    parts = [NUMBER.split(part) for part in quoted.rstrip().split(LEFT_OUT)]
    words = [f"({NUMBER.pattern})".join(re.escape(piece) for piece in pieces) for pieces in parts]
    return re.compile(".*".join(words) + r"\s*")


def not_printed(quoted, printed):
    lines = printed.splitlines()

    def is_printed(line):
        pattern = pattern_of(line)
        numbers = NUMBER.findall(line.replace(LEFT_OUT, " "))
        found = filter(None, map(pattern.fullmatch, lines))
        return any(all(map(is_near, numbers, match.groups())) for match in found)

    return [line for line in quoted
            if line.strip() and line.strip() != LEFT_OUT and not is_printed(line)]


class Workshop:
    """A folder with what a clone has beside the sources, and the command on PATH."""

    def __init__(self, graybox, source, folder):
        self.folder = Path(folder)
        for name in COPIED:
            shutil.copytree(source / name, self.folder / name)
        (self.folder / "scripts").symlink_to(source / "scripts")
        tools = self.folder / ".tools"
        tools.mkdir()
        (tools / "graybox").write_text(WRAPPER)
        (tools / "graybox").chmod(0o755)
        self.environment = dict(
            os.environ, GRAYBOX_OF_TEST=str(graybox), HOME=str(self.folder),
            PATH=f"{tools}:/usr/bin:" + os.environ["PATH"], MPLBACKEND="Agg")

    def run(self, script):
        """Standard output and error together, and whether all commands ended well."""
        done = subprocess.run(["bash", "-eo", "pipefail", "-c", script], cwd=self.folder,
                              env=self.environment, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=580)
        return done.stdout.decode(errors="replace"), done.returncode == 0


class Options:
    """What `--help` of each command knows."""

    def __init__(self, graybox):
        self.graybox, self.known = graybox, {}

    def help_of(self, words):
        if words not in self.known:
            done = subprocess.run([self.graybox, *words, "--help"], capture_output=True, text=True)
            self.known[words] = done.stdout if done.returncode == 0 else None
        return self.known[words]

    def faults(self, line, source):
        line = re.sub(r"\s#.*", "", line.removeprefix("$ "))
        for part in re.split(r"\s(?:\||&&|;)\s", re.sub(r"'[^']*'|\"[^\"]*\"", "QUOTED", line)):
            yield from self.faults_of_one(part.split(), source)

    def faults_of_one(self, words, source):
        if not words or words[0] != "graybox":
            script = words[0] if words and words[0].startswith("scripts/") else None
            if script and not (source / script).exists():
                yield f"no such script: {script}"
            text = (source / script).read_text() if script and (source / script).exists() else ""
            if script:  # options that it does not know go on to the command of that name
                text += self.help_of((Path(script).name,)) or ""
            for word in words[1:]:
                if script and word.startswith("--") and word.split("=")[0] not in text:
                    yield f"{script} does not know {word}"
            return
        command = tuple(words[1:2])
        if self.help_of(command) is None:
            yield f"no such command: graybox {' '.join(command)}"
            return
        if len(words) > 2 and re.fullmatch(r"[a-z_0-9-]+", words[2]) and self.help_of(
                command + (words[2],)) and "Subcommands:" in self.help_of(command):
            command += (words[2],)
        for word in words[1:]:
            option = re.match(r"--?[a-z][a-z-]*", word)
            if option and not re.search(rf"(^|[\s,]){option.group()}\b", self.help_of(command)):
                yield f"graybox {' '.join(command)} does not know {option.group()}"


INLINE = re.compile(r"`((?:graybox|scripts/\w+) [^`]*)`")


def faults_of_prose(options, source, page):
    """Commands within sentences and tables."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for command in INLINE.findall(text):
        for fault in options.faults(" ".join(command.split()), source):
            yield f"{page}: `{command}`: {fault}"


def joined_lines(body):
    return re.sub(r"\\\n\s*", " ", body).splitlines()


def test_page(graybox, source, page):
    options, printed, begun = Options(graybox), "", time.monotonic()
    failures = list(faults_of_prose(options, source, page))
    was_run = False  # the last fence of commands
    with tempfile.TemporaryDirectory() as folder:
        shop = Workshop(graybox, source, folder)
        for fence in fences(page):
            def fail(text, line=fence.line):
                failures.append(f"{page}:{line}: {text}")
            for command in fence.before:
                if fence.language == "long" or (fence.recordings and not fence.is_run):
                    continue
                output, is_well = shop.run(command)
                printed += output
                if not is_well:
                    fail(f"before: {command}\n{output}")
            if fence.recordings and fence.is_run:
                shop.run(f"cp -n $GRAYBOX_RECORDINGS/{fence.recordings}/* . || true")
            if fence.file:
                (shop.folder / fence.file).write_text(fence.body)
            elif fence.is_command:
                commands, quoted = fence.split()
                for line in joined_lines(commands):
                    for fault in options.faults(line, source):
                        fail(fault)
                was_run = fence.is_run
                if fence.is_run:
                    output, is_well = shop.run(commands)
                    printed += output
                    is_refusal = any(line.startswith("graybox: ") for line in quoted)
                    if is_well == is_refusal:
                        fail(f"{'went well' if is_well else 'failed'}:\n{commands}{output}")
                    for line in not_printed(quoted, output):
                        fail(f"quotes: {line}\nprinted:\n{output}")
            elif fence.language == "sh" and SHOWN.search(fence.body):
                fail("commands in a fence that is not run")
            elif fence.language == "python" and not re.search(r"^(import|from) graybox", fence.body,
                                                              re.MULTILINE):
                (shop.folder / "page.py").write_text(fence.body)
                output, is_well = shop.run("/usr/bin/python3 page.py")
                printed += output
                was_run = True
                if not is_well:
                    fail(f"failed: Python\n{output}")
            elif fence.language == "" and was_run:
                for line in not_printed(fence.body.splitlines(), printed):
                    fail(f"quotes: {line}\nprinted:\n{printed}")
    print(f"{page.relative_to(source)}: {time.monotonic() - begun:.1f} s")
    return failures


def pages_of(source):
    return [source / "README.md", *sorted(source.glob("docs/*.md")),
            *sorted(source.glob("docs/*/*.md"))]


def long_fences(source, pages):
    count, begins_long = 0, set()
    for page in pages:
        name, commands = str(page.relative_to(source)), 0
        for fence in fences(page):
            commands += fence.is_command
            if fence.language == "long":
                count += 1
                print(f"{name}:{fence.line}: {fence.body.strip().splitlines()[0]}")
                if commands <= 1:
                    begins_long.add(name)
    print(f"{count} fences are marked long, {MOST_LONG} at most")
    failures = [] if count <= MOST_LONG else [f"{count} fences are marked long"]
    failures += [f"{name}: its first commands take long: begin with a small variant"
                 for name in sorted(begins_long - set(BEGINS_LONG))]
    if pages == pages_of(source):
        failures += [f"{name}: no longer begins with a long fence: take it out of BEGINS_LONG"
                     for name in sorted(set(BEGINS_LONG) - begins_long)]
    return failures


def main(arguments):
    graybox, source = Path(arguments[0]).resolve(), Path(arguments[1]).resolve()
    if arguments[2:3] == ["--long"]:
        failures = long_fences(source, [Path(each).resolve() for each in arguments[3:]] or pages_of(source))
    else:
        pages = [Path(each).resolve() for each in arguments[2:]] or pages_of(source)
        failures = [line for page in pages for line in test_page(graybox, source, page)]
    print("\n".join([*failures, f"{len(failures)} faults"]))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
