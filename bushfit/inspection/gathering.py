"""Search for tests in files, sheets of workbooks, and folders."""

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.campaign.campaign import TEST_FILES
from bushfit.campaign.copies import copied_points, group_copies
from bushfit.caveat import Caveat
from bushfit.errors import BushfitError, MeasurementError, NoColumnError, NoTestError, ResonanceTestError, printable
from bushfit.fitting.measured_loop import MeasuredLoop
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.preparation import prepare_loops, prepare_sweeps
from bushfit.geometry import Direction
from bushfit.inspection.labels import count_temperatures
from bushfit.inspection.opening import inspect_file
from bushfit.inspection.recognition import open_table, recognize_table
from bushfit.inspection.record import Inspection
from bushfit.reading.headers import ERRORS, LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.reading.instruments import word_for_part
from bushfit.reading.labelled import same_text
from bushfit.reading.layout import FileFormat
from bushfit.reading.levels import split_conditions
from bushfit.reading.lines import is_summary_row
from bushfit.reading.measurement import FEWEST_LOOP_ROWS, Loop, Sweep
from bushfit.reading.names import NO_LABELS, Labels, labels_above, labels_in_names
from bushfit.reading.parts import open_file
from bushfit.reading.roles import CONDITIONS
from bushfit.reading.table import Table
from bushfit.units import is_unit

#: Role of the column that a file lacks, by the key of a campaign that states it.
_INSTEAD_OF_COLUMN = {
    **{f"at_{role}": role for role in ("amplitude", "frequency")},
    **dict.fromkeys(("sampling_rate", "rate", "frequency", "waveform"), "time"),
}


@dataclass(frozen=True)
class TestSource:
    """A file, or a sheet of a workbook, that contains a test.

    Args:
        file: test file.
        sheet: name of a sheet, if the workbook has several; None for the whole file.
        is_named: True if the user named the file itself, False if it was found in a folder.
        test_options: what the user states on the test, by key of [[loops]] and [[sweeps]].
        of_book: labels (quantities stated in text) in the sheets of the workbook that contain no test.
        differs_in_force: True if the force in its name is the preload, because names of other tests state other forces.
    """

    file: Path
    sheet: str | None = None
    is_named: bool = True
    test_options: Mapping[str, Any] = field(default_factory=dict)
    of_book: Labels = NO_LABELS
    differs_in_force: bool = False

    def __str__(self) -> str:
        """File, and name of its sheet, for sentences."""
        return f"{self.file}, {word_for_part(self.file)} {self.sheet}" if self.sheet else str(self.file)

    def without(self, *keys: str) -> "TestSource":
        """Copy of the test source without the options of the given keys."""
        return replace(self, test_options={key: value for key, value in self.test_options.items() if key not in keys})

    def inspect(self) -> Inspection:
        """Inspect the test: its kind (loop, sweep or raw history), its contents, and anything unusual in it."""
        return inspect_file(self.file, self.test_options, self.of_book, differs_in_force=self.differs_in_force)


def gather(paths: Sequence[Path], test_options: Mapping[str, Any]) -> tuple[list[TestSource], list[Caveat]]:
    """Find the tests in files, in the sheets of workbooks, and in folders and their subfolders.

    Args:
        paths: files and folders. A named file is not searched, unless it is a workbook with several sheets.
        test_options: keys of [[loops]] and [[sweeps]] that apply to all tests, with the values that TOML gives.

    Returns:
        The tests in order, and for each file and sheet without a test the reason: of the kind "to_reduce" for a test
        that `bushfit reduce` converts, else "left_out".

    Raises:
        NoTestError: a folder without a test.
    """
    sources, left_out = list[TestSource](), list[Caveat]()
    for path in paths:
        files = [*list_folder(path, left_out)] if path.is_dir() else [TestSource(path)]
        of_path = [test for file in files for test in split_sheets(file, test_options, left_out)]
        sources += of_path
        if not of_path:
            raise NoTestError(**ERRORS["no_test"], file=path, found="; ".join(map(str, left_out)) or "nothing")
    tests = [test for source in distribute_options(sources, test_options) for test in split_rows(source, left_out)]
    forces = [labels_in_names(test.sheet or "", test.file.stem).force for test in tests]
    if len({*forces} - {None}) > 1:
        tests = [replace(test, differs_in_force=True) for test in tests]
    return tests, left_out


def list_folder(folder: Path, left_out: list[Caveat]) -> Iterator[TestSource]:
    """List the files of a folder and its subfolders by name; a subfolder such as "P01" names the specimen of its files.

    Args:
        folder: folder to search; subfolders with results of bushfit, which contain a model.json, are left out.
        left_out: list to which a warning on each other file is added.

    Yields:
        Files that may contain tests.
    """
    for path in sorted(folder.iterdir()):
        why = ""
        if path.name.startswith((".", "~$")):
            continue
        if not path.exists():
            why = "a broken link"
        elif printable(path.name) != path.name:
            why = "its name contains characters that are not text; rename it"
        elif path.is_dir() and not os.access(path, os.R_OK | os.X_OK):
            why = "no permission to read this folder"
        elif path.is_dir() and (path / "model.json").is_file():
            why = "results of bushfit"
        elif path.is_dir() and not path.is_symlink():
            number = labels_in_names(path.name).specimen_number
            keys = {"specimen_number": number} if number else {}
            for file in list_folder(path, left_out):
                yield replace(file, test_options={**file.test_options, **keys})
        elif path.is_file() and path.suffix.lower() in TEST_FILES:
            yield TestSource(path, is_named=False)
        else:
            why = "a link to a folder" if path.is_dir() else "not a table (by its extension)"
        left_out += [Caveat("left_out", why).about(printable(str(path)))] if why else []


def split_sheets(file: TestSource, test_options: Mapping[str, Any], left_out: list[Caveat]) -> list[TestSource]:
    """Select the sheets of a workbook that may contain a test, or the file itself if it has one sheet.

    Args:
        file: test file; a file with one sheet that the user named is accepted without a check of its columns.
        test_options: what the user states on all tests, by campaign key; with the key "sheet", the file is one test.
        left_out: list to which a warning on each sheet or file without a test is added.

    Returns:
        The tests.
    """
    sheets, whole = [], distribute_options([file], test_options)
    with suppress(BushfitError):  # which the inspection of the file reports
        sheets = [] if test_options.get("sheet") else list(open_file(file.file, FileFormat()).parts)
    parts = [replace(file, sheet=sheet.sheet) for sheet in sheets] if len(sheets) > 1 else [file]
    if len(parts) == 1 and file.is_named:
        return whole
    tests, failed = list[TestSource](), dict[str | None, Caveat]()
    for part in distribute_options(parts, test_options):
        try:
            try:
                recognize_table(part.file, part.test_options)
            except NoColumnError:  # the stated column may be one of another file
                recognize_table(part.file, part.without("columns").test_options)
        except NoTestError as error:
            why = f"{error.problem} ({error.found})" if error.found else f"{error.problem}; {error.hint}"
            kind = "to_reduce" if isinstance(error, ResonanceTestError) else "left_out"
            failed[part.sheet] = Caveat(kind, why).about(part)
            continue
        except BushfitError:  # which the inspection of the test reports
            pass
        tests.append(part)
    if not tests and file.is_named:  # the error of the whole file says why
        return whole
    left_out += failed.values()
    means = [test for test in tests if test.sheet and is_summary_row([test.sheet])]
    if len(means) < len(tests):
        tests = [test for test in tests if test not in means]
        left_out += [Caveat("left_out", "a summary of the other sheets, by its name").about(test) for test in means]
    if failed and len(parts) > 1:
        of_book = labels_above(line for sheet in sheets if sheet.sheet in failed for line in sheet.head)
        tests = [replace(test, of_book=of_book) for test in tests]
    return tests


def split_rows(source: TestSource, left_out: list[Caveat]) -> list[TestSource]:
    """Split a file with several tables, or with columns for direction, part number, run, temperature or preload.

    Each table, and each level in such a column, is a test. The runs of a sweep are repeats and are not split. The runs
    of a loop are split only if time restarts in each run.

    Args:
        source: file or sheet.
        left_out: list to which a warning on the rows of each combination without a test is added.

    Returns:
        The tests.
    """
    test_options, tests = source.test_options, list[TestSource]()
    try:
        table, is_sweep = recognize_table(source.file, source.without("direction", "specimen_number").test_options)
        columns = dict(table.row_labels)
        if "run" in columns and "time" in table.roles:
            time = table.read({"time": table.roles["time"]}, fewest_rows=1)[0]["time"]
            if np.all(np.diff(time) > 0.0):
                del columns["run"]
        labels = list(zip(*(texts for _, texts in columns.values()), strict=True))
        levels = {row: [dict[str, str]()] for row in labels}
        if not table.roles.keys().isdisjoint(CONDITIONS):
            rows_of = {row: np.flatnonzero([label == row for label in labels]) for row in levels}
            if not columns:
                rows_of = {(): np.arange(sum(1 for _ in table.rows()))}
            levels = {row: split_conditions(table, rows, test_options) for row, rows in rows_of.items()}
        below = () if test_options.get("header_line") else table.other_tables
    except BushfitError:  # which the inspection of the file reports
        return [source]
    for texts, tests_at_levels in levels.items():
        if "run" in columns and not is_sweep and (count := labels.count(texts)) < FEWEST_LOOP_ROWS:
            why = f"{count} rows of run {', '.join(texts)} are too few for a loop"
            left_out.append(Caveat("left_out", why).about(source))
            continue
        keys: dict[str, Any] = dict(zip(columns, texts, strict=True))
        run: dict[str, Any] = {}
        if text := keys.pop("run", None):
            run = {"rows": {table.headers[columns["run"][0]]: text}}
        is_direction = keys.get("direction", "axial") in [*Direction]
        is_stated = all(same_text(str(test_options.get(key, text)), text) for key, text in keys.items())
        if is_direction and is_stated and tests_at_levels:
            tests += [replace(source, test_options={**test_options, **keys, **run, **test}) for test in tests_at_levels]
        elif texts:
            why = "other values were stated" if is_direction else "the direction is unknown"
            left_out.append(Caveat("left_out", f"rows of {', '.join(texts)} are not used: {why}").about(source))
    of_tables = [replace(source, test_options={**test_options, "header_line": line}) for line, _ in below]
    return [*(tests or [source]), *of_tables]


def distribute_options(sources: Sequence[TestSource], test_options: Mapping[str, Any]) -> list[TestSource]:
    """Give each test the options that apply to it.

    The option for a column is dropped for tests without this column, and the option for a unit is dropped for tests
    whose header states the unit. A temperature that selects rows is dropped for files without a temperature column. An
    option that stands for a column is dropped for tests with this column, if other tests lack it.

    Args:
        sources: the tests.
        test_options: what the user states on all tests, by campaign key such as "direction".

    Returns:
        The tests with their options.
    """
    tables: Mapping[str, Mapping[str, str]] = {key: test_options.get(key, {}) for key in ("columns", "units")}
    by_source = [
        {**source.test_options, **test_options, **tables, **({"sheet": source.sheet} if source.sheet else {})}
        for source in sources
    ]
    for key, role in ((key, role) for key, stated_by_role in tables.items() for role in stated_by_role):
        needs = [needs_option(source.file, key, role, keys) for source, keys in zip(sources, by_source, strict=True)]
        for keys in (keys for keys, one in zip(by_source, needs, strict=True) if one is False and True in needs):
            keys[key] = {name: text for name, text in keys[key].items() if name != role}
    stated_keys = [key for key in (*_INSTEAD_OF_COLUMN, "temperature") if test_options.get(key) and len(sources) > 1]
    recognized = dict[int, Table]()
    for index, source in enumerate(sources) if stated_keys else ():
        with suppress(BushfitError):  # which the inspection of the file reports
            recognized[index] = recognize_table(source.file, by_source[index])[0]
    for name in stated_keys:
        column = _INSTEAD_OF_COLUMN.get(name)
        numbers = {
            n: int(column not in one.roles) if column else count_temperatures(one) for n, one in recognized.items()
        }
        for index, number in numbers.items():
            if number == 0 and max(numbers.values()) > (0 if column else 1):
                by_source[index][name] = None
        if name in ("at_amplitude", "at_frequency"):
            of_option = [sources[index] for index in recognized if by_source[index][name]]
            check_one_level(of_option, name, str(test_options[name]))
    return [replace(source, test_options=keys) for source, keys in zip(sources, by_source, strict=True)]


def check_one_level(sources: Sequence[TestSource], key: str, option_text: str) -> None:
    """Check that the names of tests allow one amplitude or frequency for all of them.

    Args:
        sources: tests to which the option applies.
        key: "at_amplitude" or "at_frequency".
        option_text: value of the option, such as "0.1 mm"; its unit completes a name without one, such as "A=0.5".

    Raises:
        MeasurementError: the names state different amplitudes or frequencies.
    """
    unit = option_text.lstrip("+-.,0123456789eE ")
    levels = dict[str, str]()
    for source in sources:
        names = [name for name in (source.sheet, source.file.stem) if name]
        marked = [one for one in labels_in_names(*(f"{name} {unit}" for name in names)).quantities if one.is_marked]
        labels = labels_in_names(*names) | Labels(tuple(marked))
        if is_unit(unit) and len(found := labels.of_dimension(unit)) == 1:
            levels[str(source)] = found[0].text
    if len(set(levels.values())) > 1:
        option = f"--{key.replace('_', '-')}"
        raise MeasurementError(
            f"{option} applies to all these tests, and their names state different values",
            found=f"{option} {option_text}; " + ", ".join(f"{level} in {name}" for name, level in levels.items()),
            expected="names with one value, or this option left out",
            hint=f"leave {option} out and write the value with its unit into each name, or state {key} for each test "
            "in the campaign",
        )


def needs_option(file: Path, key: str, role: str, test_options: Mapping[str, Any]) -> bool | None:
    """Check whether a stated column or unit applies to a file.

    Args:
        file: test file.
        key: "columns" or "units".
        role: role of the column, such as "force".
        test_options: what the user states on the test, by campaign key such as "direction".

    Returns:
        For "columns", True if the file has the stated column; for "units", True if the header of the column states no
        unit. False if not, and None if the file cannot be read or has no column of this role.
    """
    names = SWEEP_COLUMNS if role in SWEEP_COLUMNS else LOOP_COLUMNS
    columns = {role: test_options["columns"][role]} if key == "columns" else test_options["columns"]
    try:
        column = open_table(file, names, {**test_options, "units": {}, "columns": columns}).roles.get(role)
    except NoColumnError:
        return False
    except BushfitError:  # which the inspection of the file reports
        return None
    return None if column is None else key == "columns" or column.unit is None


def with_contradictions(files: Sequence[Inspection]) -> list[Inspection]:
    """Compare inspected tests, and add an oddity to those with identical data or contradictory results.

    Only tests of one part in one direction can contradict each other.

    Args:
        files: inspections of the tests, in order.

    Returns:
        The inspections, with the added oddities.
    """
    loops = [inspection.measured for inspection in files if isinstance(inspection.measured, Loop)]
    sweeps = [inspection.measured for inspection in files if isinstance(inspection.measured, Sweep)]
    names = {id(inspection.measured): str(inspection.file.parent / inspection.label) for inspection in files}
    oddities: defaultdict[int, list[Caveat]] = defaultdict(list)
    copied = defaultdict[int, list[str]](list)
    pairs = [(copy, test) for copies in group_copies(loops) for copy, test in permutations(copies, 2)]
    shared = [(sweeps[copy], sweeps[original]) for copy, original in copied_points(sweeps) if copy != original]
    for test, copy in (*pairs, *shared, *(pair[::-1] for pair in shared)):
        copied[id(test)].append(names[id(copy)])
    for test_id, sources in copied.items():
        sentence = f"the same data are in {' and '.join(sources)}: a campaign uses these data once"
        oddities[test_id].append(Caveat("same_data", sentence))
    placed = [inspection for inspection in files if inspection.direction is not None and inspection.kind != "history"]
    for part in dict.fromkeys(inspection.part for inspection in placed):
        tests = [inspection.measured for inspection in placed if inspection.part == part]
        loops = [test for test in tests if isinstance(test, Loop)]
        sweeps = [test for test in tests if isinstance(test, Sweep)]
        prepared: list[MeasuredLoop | MeasuredSweep] = [*prepare_loops(loops)] if len(loops) > 1 else []
        prepared += [*prepare_sweeps(sweeps)] if len(sweeps) > 1 else []
        for one in prepared:
            oddities[id(one.test)] += [one.contradiction] if one.contradiction else []
    return [replace(inspection, odd=(*inspection.odd, *oddities[id(inspection.measured)])) for inspection in files]
