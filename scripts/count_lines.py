#!/usr/bin/env python3
"""Lines of Rust code of the repository: no comments, no blank lines, no tests.

    scripts/count_lines.py [COMMIT]...     # of commits, else of the work tree's HEAD

Tests are files below `tests`, `benches` or `examples`, `tests.rs` and `test_*.rs`, and what stands behind
`#[cfg(test)]` up to the end of its item.
"""

import re
import subprocess
import sys

AREAS = ["shared/method", "shared/data", "shared/runtime", "shared/tools", "processes",
         "fleet", "ros2", "view", "python", "fuzz"]


def git(*arguments):
    """What git answers."""
    return subprocess.run(["git", *arguments], check=True, capture_output=True).stdout


def is_test(path):
    """Whether a whole file is there for tests, benchmarks or as an example."""
    parts = path.split("/")
    folders = {"tests", "benches", "examples"}
    return bool(folders & set(parts[:-1])) or parts[-1] == "tests.rs" or parts[-1].startswith("test_")


def without_tests(lines):
    """The lines of a formatted file outside of items marked `#[cfg(test)]`."""
    kept, at = [], 0
    while at < len(lines):
        line = lines[at]
        if line.strip() != "#[cfg(test)]":
            kept.append(line)
            at += 1
            continue
        indent = line[: len(line) - len(line.lstrip())]
        at += 1
        while at < len(lines) and lines[at].lstrip().startswith("#["):
            at += 1
        # An item of one line ends there, another one at the brace below its first letter.
        if at < len(lines) and not lines[at].rstrip().endswith((";", "}")):
            while at < len(lines) and lines[at].rstrip() not in (indent + "}", indent + "};", indent + ");"):
                at += 1
        at += 1
    return kept


def count(text):
    """Lines of code of a file."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    lines = without_tests(text.splitlines())
    return sum(1 for line in lines if line.strip() and not line.strip().startswith("//"))


def main():
    """Prints a column for each commit."""
    commits = sys.argv[1:] or ["HEAD"]
    columns = []
    for commit in commits:
        totals = dict.fromkeys(AREAS, 0)
        for path in git("ls-tree", "-r", "--name-only", commit).decode().splitlines():
            area = next((area for area in AREAS if path.startswith(area + "/")), None)
            if area and path.endswith(".rs") and not is_test(path):
                totals[area] += count(git("show", f"{commit}:{path}").decode())
        columns.append(totals)
    for area in AREAS:
        print(f"{area:16}" + "".join(f"{column[area]:>10}" for column in columns))
    print(f"{'all':16}" + "".join(f"{sum(column.values()):>10}" for column in columns))


if __name__ == "__main__":
    main()
