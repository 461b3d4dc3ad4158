"""Results of commands as lines of text, and their comparison with stored references.

A line of data is `name = values` or `name = value ± standard error`, compared relative to its largest number; gains of
chi-square, which span decades, are each compared on their own. In other lines, words are compared exactly and numbers
with a tolerance.
"""

import difflib
import json
import re
from collections.abc import Iterator
from html import unescape
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bushfit.report.plots.style import to_image

#: Values shown of a long column, entries of a long list, and lines of a long text, evenly spaced.
VALUES, ENTRIES, LINES = 4, 6, 200
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
#: Name, values, numbers of values, mean and root mean square of a line of data.
DATA_LINE = re.compile(r"(?!\|)(.+?) = ([-+.\de ]+?)(?: \((\d+ of \d+) values, mean (\S+), rms (\S+)\))?(?: ± \S+)?")
#: Keys, columns and texts that differ from run to run or from release to release.
CHANGING = re.compile(r"seconds|key|inputs|version|sha256|provenance")
CHANGING_TEXT = re.compile(
    r'bushfit \d+\.\d+\.\d+.*| time="[\d.]+"|(?<=with an error), in [\d.]+ s|\b(?=\d*[a-f])[0-9a-f]{12,}\b'
)
#: Relative tolerances of printed numbers, of data, and of data that are errors, derivatives or small differences.
PRINTED, DATA, DERIVED = 0.02, 1e-3, 0.02
DERIVATIVES = re.compile(
    r"std|ci95|covar|correl|profile|prob|evidence|chi|resid|error|after|noise|gain|signif|odds|interval|gap|differ|phase"
)
INLINE = r"</?(?:b|i|em|strong|code|a|sub|sup)\b[^>]*>"


def sample(count: int, shown: int) -> list[int]:
    """Indices of at most `shown` of `count` entries, evenly spaced, with the first and the last."""
    return sorted({*np.linspace(0, count - 1, min(count, shown)).round().astype(int).tolist()})


def numbers_line(name: str, numbers: Any) -> str:
    """A line `name = values`; a long list in part, with counts, mean and root mean square."""
    values = np.ravel(np.ma.filled(np.ma.asarray(numbers, float), np.nan))
    finite = values[np.isfinite(values)]
    texts = [f"{finite[index]:.6g}" for index in sample(finite.size, VALUES)]
    if values.size > VALUES and finite.size:
        mean, rms = np.mean(finite), np.sqrt(np.mean(finite**2))
        texts.append(f"({finite.size} of {values.size} values, mean {mean:.6g}, rms {rms:.6g})")
    return f"{name} = {' '.join(texts) or 'nothing'}"


def is_numeric(values: list[Any]) -> bool:
    """Whether a list holds numbers only, maybe in lists of one length."""
    if all(isinstance(value, list) for value in values):
        return len({len(value) for value in values}) == 1 and all(is_numeric(value) for value in values)
    return all(isinstance(value, int | float | None) and not isinstance(value, bool) for value in values)


def scaled(covariance: dict[str, Any]) -> dict[str, Any]:
    """A covariance and its changes relative to standard errors, to four decimals; smaller changes are rounding."""
    size = np.sqrt(np.diag(covariance["matrix"]))
    size[size == 0.0] = 1.0
    parts = {key: part / np.outer(size, size) for key in ("matrix", "spread") if (part := covariance[key])}
    return covariance | {key: (part.round(4) + 0.0).tolist() for key, part in parts.items()}


def document_lines(name: str, value: Any) -> Iterator[str]:
    """Lines of a JSON document: one for each list of numbers and each other value, after its path."""
    if isinstance(value, dict):
        for key, part in (scaled(value) if "matrix" in value else value).items():
            if key == "value" and value.get("stderr"):
                yield f"{numbers_line(f'{name}.value', [part])} ± {value['stderr']:.6g}"
            elif not CHANGING.search(key):
                yield from document_lines(f"{name}.{key}", part)
    elif isinstance(value, list) and value and is_numeric(value):
        yield numbers_line(name, value)
    elif isinstance(value, list) and value:
        for index in sample(len(value), ENTRIES):
            yield from document_lines(f"{name}[{index} of {len(value)}]", value[index])
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield numbers_line(name, [value])
    elif value is not None:
        yield f"{name}: {CHANGING_TEXT.sub('', str(value))}"


def table_lines(table: pd.DataFrame) -> Iterator[str]:
    """Lines of a table: one for each column; texts as runs of equal cells."""
    yield f"{len(table)} rows"
    for name, column in table.items():
        if CHANGING.search(str(name)):
            continue
        if pd.api.types.is_numeric_dtype(column) and len(column):
            yield numbers_line(str(name), column)
        else:
            texts = (CHANGING_TEXT.sub("", str(text)) for text in column)
            runs = [(text, len([*cells])) for text, cells in groupby(texts)]
            shown = ", ".join(f"{runs[index][0]} x {runs[index][1]}" for index in sample(len(runs), ENTRIES))
            yield f"{name}: {shown}; {len(runs)} runs"


def text_lines(text: str) -> list[str]:
    """Lines of a text without lines of a table's frame; blanks count as one."""
    texts = [CHANGING_TEXT.sub("", " ".join(line.split())) for line in text.splitlines()]
    lines = [f"| {line}" for line in texts if line.strip(" ─━╭╮╰╯│|")]
    return [lines[index] for index in sample(len(lines), LINES)] + [f"{len(lines)} lines"] * (len(lines) > LINES)


def printed_lines(text: str) -> list[str]:
    """Lines of what a command prints: text, or a JSON document."""
    try:
        return [*document_lines("", json.loads(text))]
    except json.JSONDecodeError:
        return text_lines(text)


def file_lines(path: Path) -> Iterator[str]:
    """Lines of a result file by its kind."""
    if path.suffix == ".fmu":
        return
    if path.suffix == ".xlsx":
        for sheet, table in pd.read_excel(path, sheet_name=None, engine="calamine").items():
            yield from (f"sheet {sheet}", *table_lines(table))
        return
    text = path.read_text(encoding="utf-8-sig")
    if path.suffix == ".csv":
        separator, decimal = (";", ",") if ";" in text.partition("\n")[0] else (",", ".")
        yield from table_lines(pd.read_csv(path, sep=separator, decimal=decimal))
    elif path.suffix == ".html":
        text = re.sub(rf"<(svg|style|script)\b.*?</\1>|{INLINE}", "", text, flags=re.DOTALL)
        yield from text_lines(unescape(re.sub(r"<[^>]*>", "\n", text)))
    elif path.suffix in (".png", ".svg", ".pdf"):
        yield from text.splitlines()  # of describe_figure
    else:
        yield from printed_lines(text)


def describe_figure(figure: Figure, form: str, *, outlines: bool = True) -> bytes:
    """Description of a figure in place of a picture: texts, and the points of all lines and areas."""
    if not outlines:
        return to_image(figure, form, outlines=outlines)  # for a page
    lines = [line for text in figure.texts for line in text_lines(text.get_text())]
    for number, axes in enumerate(figure.axes, 1):
        legend = axes.get_legend()
        texts = [text.get_text() for text in (*(legend.get_texts() if legend else ()), *axes.texts)]
        texts = [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), axes.get_xscale(), axes.get_yscale(), *texts]
        lines += text_lines(f"panel {number}: {'; '.join(' '.join(text.split()) for text in texts)}")
        for line in axes.get_lines():
            lines += [numbers_line("x", line.get_xdata()), numbers_line("y", line.get_ydata())]
        for area in axes.collections:
            points = [np.ravel(path.vertices) for path in area.get_paths()]
            lines += [numbers_line("area", np.concatenate(points))] if points else []
            lines.append(numbers_line("offsets", area.get_offsets()))
        lines += [numbers_line("image", image.get_array()) for image in axes.images]
    return "\n".join(lines).encode()


def agree(expected: str, obtained: str) -> bool:
    """Whether the numbers of two lines with equal words agree; the last printed digit of a text may differ by one."""
    if expected == obtained:
        return True
    lines = [DATA_LINE.fullmatch(line) for line in (expected, obtained)]
    if all(lines):
        (name, values, count, *means), other = (line.groups(default="") for line in lines)
        old, new = (np.array(" ".join(texts).split(), float) for texts in ((values, *means), (other[1], *other[3:])))
        in_noise = re.search(r"covariance|prior.distance|chi-square gain", name)
        least = 1.0 if in_noise else float(expected.partition(" ± ")[2] or 0.0)
        scale = np.maximum(np.abs(old) if "chi-square gain" in name else np.abs(old).max(initial=0.0), least)
        tolerance = DERIVED if DERIVATIVES.search(name) else DATA
        alike = count == other[2] and agree(f"| {name}", f"| {other[0]}")
        return alike and bool(np.all(np.abs(new - old) <= tolerance * scale + 1e-12))
    texts = NUMBER.findall(expected)
    old, new = (np.clip(np.array(numbers, float), -1e99, 1e99) for numbers in (texts, NUMBER.findall(obtained)))
    parts = [text.lower().partition("e") for text in texts]
    digits = np.array([len(number.partition(".")[2]) - int(exponent or 0) for number, _, exponent in parts], float)
    last = np.maximum(1.01 * 10.0 ** np.clip(-digits, -99, 99), 1e-12)  # less is rounding of zero
    return bool(np.all(np.isclose(new, old, PRINTED, last)))


def check(obtained: Path, expected: Path) -> None:
    """Compare two references; for `file_regression.check(..., check_fn=check)`."""
    old, new = (path.read_text(encoding="utf-8").splitlines() for path in (expected, obtained))
    masked = [[NUMBER.sub("#", line) for line in lines] for lines in (old, new)]
    if masked[0] != masked[1]:
        different = [*difflib.unified_diff(*masked, "expected", "obtained", n=1, lineterm="")]
    else:
        different = [f"- {one}\n+ {other}" for one, other in zip(old, new, strict=True) if not agree(one, other)]
    assert not different, f"{expected.name} differs in {len(different)} lines\n" + "\n".join(different[:60])
