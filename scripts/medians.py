"""What accuracy.py and speed.py share: a file of medians, its table in a page, and its numbers in the text of pages.

A number in a page stands behind <!-- median of NAME: KEY -->; each script writes those of its own keys. Figures are
tuples of column, key, decimals, and whether less is better (None: not compared).
"""

import json
import pathlib
import re
import statistics
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
MEDIAN = re.compile(r"(<!-- median of (.+?): (\w+) -->)[0-9.]+")


def read(path):
    return tomllib.loads(path.read_text()) if path.exists() else {}


def spreads(figures, runs):
    """Median, least and most of each figure that the runs have."""
    values = {key: [run[key] for run in runs if run.get(key) is not None] for _, key, *_ in figures}
    return {key: [statistics.median(of), min(of), max(of)] for key, of in values.items() if of}


def cell(spread, decimals):
    if spread is None:
        return "-"
    median, least, most = (f"{value:.{decimals}f}" for value in spread)
    return median if least == most else f"{median} ({least} to {most})"


def table(figures, first_column, results):
    rows = [f"| {first_column} | " + " | ".join(name for name, *_ in figures) + " |", "|" + "-|" * (len(figures) + 1)]
    for name, result in results.items():
        cells = [cell(result.get(key), decimals) for _, key, decimals, _ in figures]
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def worse(figures, result, baseline):
    """Names of the figures whose median is outside the baseline's spread, on its bad side."""
    found = []
    for name, key, decimals, is_less_better in figures:
        if is_less_better is None or key not in result or key not in baseline:
            continue
        median, (_, least, most) = result[key][0], baseline[key]
        step = 0.5 * 10**-decimals
        if median > most + step if is_less_better else median < least - step:
            found.append(f"{name} {median:.{decimals}f}, baseline {least:.{decimals}f} to {most:.{decimals}f}")
    return found


def write_file(path, header, results):
    lines = [header]
    for name, result in results.items():
        lines += ["", f"[{json.dumps(name)}]"]
        lines += [f"{key} = [{', '.join(f'{value:.6g}' for value in map(float, v))}]" for key, v in result.items()]
    path.write_text("\n".join(lines) + "\n")


def write_pages(figures, results, page, script, text_of_table):
    """Numbers of these figures in all pages; in `page` the table, between the two marks of the script."""
    decimals = {key: n for _, key, n, _ in figures}
    begin, end = (f"<!-- scripts/{script}: {word} -->" for word in ("begin", "end"))

    def median(mark):
        return f"{mark[1]}{results[mark[2]][mark[3]][0]:.{decimals[mark[3]]}f}" if mark[3] in decimals else mark[0]

    for path in PAGES:
        text = path.read_text()
        changed = MEDIAN.sub(median, text)
        if path == page:
            before, rest = changed.split(begin)
            changed = before + begin + "\n" + text_of_table + "\n" + end + rest.split(end)[1]
        if changed != text:
            path.write_text(changed)
