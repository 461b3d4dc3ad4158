"""Spoiled input of every kind, to every command: status 2, one error that says what and where, nothing written, and
no more memory or time than a command may take."""

import ast
import errno
import gzip
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bombs import far_apart, workbook
from commandline import Done, call
from paper import BUSHING
from references import check, text_lines
from shell import refused
from spoiled import FILES, ROWS, Spoiled

from bushfit.cli import cli

ERROR = re.compile(r"^(bushfit: error: |Error: )", re.MULTILINE)
#: Address space [bytes] and processor time [s] of a command: a fit of the paper's campaign takes a third of each.
LIMITS = (1_500_000_000, 30)
LOOP = '[[loops]]\nfile = "{}"\ndirection = "axial"\n'
SECRET = 'url = https://user:TOPSECRET@host\n\tTOPSECRET = "more"\n' * 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """One folder for all, because most rows spoil one file of five."""
    return tmp_path_factory.mktemp("spoiled")


def lay_out(folder: Path, row: Spoiled) -> set[str]:
    """The files of a row and none that another row had; their names."""
    files = FILES | row.files
    for left in (path for path in folder.iterdir() if path.is_file() and path.name not in files):
        left.unlink()
    for name, content in files.items():
        if content is None:
            (folder / name).unlink(missing_ok=True)
        else:
            (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return {path.name for path in folder.iterdir()}


def assert_refused(row: Spoiled, done: Done | subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert "internal error of bushfit" not in done.stderr
    assert len(ERROR.findall(done.stderr)) == 1, done.stderr
    for words in row.says:
        assert words in done.stderr, done.stderr


@pytest.mark.parametrize("table", sorted({row.table for row in ROWS}))
def test_one_error_and_nothing_written(table, folder, file_regression):
    lines = []
    for row in (row for row in ROWS if row.table == table):
        before = lay_out(folder, row)
        done = call(folder, *row.arguments)
        assert_refused(row, done)
        assert {path.name for path in folder.iterdir()} == before
        lines += [row.name, *text_lines(done.stderr)]
    file_regression.check("\n".join(lines) + "\n", basename=table, encoding="utf-8", check_fn=check)


@pytest.mark.parametrize("command", ["predict", "simulate"])
def test_a_disk_that_fills_up_after_the_work(command, folder, monkeypatch):
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    words = ("x: the results cannot be written", "free some space")
    row = Spoiled("disk", command, (command, "model.json", "--json", "-q"), words)
    before = lay_out(folder, row)
    assert_refused(row, call(folder, *row.arguments))
    assert {path.name for path in folder.iterdir()} == before


def test_every_command_is_among_them():
    commands = {row.command[0] for row in ROWS}
    assert set(cli.commands or cli.list_commands(None)) <= commands  # type: ignore[arg-type]


#: Errors that no test expects: of schedulers, compilers and systems that are not here, and what other words check.
UNEXPECTED = {

    "a rig or sleeve is too compliant to be simulated in time", "module | has no attribute", "no FMU for this system",
    "no Dask worker is left", "no worker process starts",
    "the compiler of the FMU failed", "the connection to the Dask scheduler is lost",
    "the effect | of | cannot be imported",
    "the files contain several directions",
    "the law cannot be run", "the results do not fit together",
    "the results have different kinds of motion", "the static and the dynamic fit do not converge in turn",
    "matplotlib cannot read its settings and no picture is drawn",
    "there are results already", "this cannot be compared", "this format represents one bushing",
    "too few points for the fit",
}  # fmt: skip


def test_every_error_is_expected_by_a_test(root):
    """Three words of its sentence at least: where it is no longer raised, that test fails."""
    files = [file for ending in ("py", "toml") for file in (root / "tests").rglob(f"*.{ending}")]
    files += (root / "tests/cli/test_reference_outputs").glob("*.txt")
    texts = [file.read_text(encoding="utf-8").replace("\\n", " ") for file in files if file != Path(__file__)]
    expected = " ".join(re.findall(r"\w+", re.sub(r"[\"']", " ", " ".join(texts))))
    told = {*sentences(root / "bushfit")}
    assert {each for each in told if not any(words in expected for words in threes(each))} == UNEXPECTED


def threes(sentence: str) -> list[str]:
    """Every three words in a row of each part of a sentence, between the values in it."""
    parts = [part.split() for part in sentence.split(" | ")]
    return [" ".join(words[first : first + 3]) for words in parts for first in range(len(words) - 2)]


def sentences(package: Path) -> Iterator[str]:
    """The sentence of each error in the code, its words alone, if three follow each other."""
    for file in package.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and node.args
                and re.search(r"\b\w*(Error|\.error)\(", ast.unparse(node)[:60])
            ):
                texts = [part.value for part in ast.walk(node.args[0]) if isinstance(part, ast.Constant)]
                sentence = " | ".join(" ".join(re.findall(r"\w+", str(text))) for text in texts)
                if threes(sentence):
                    yield sentence


def bounded(folder: Path, *arguments: str, times: int = 1) -> Done:
    """A command in a process of its own that the system lets have so much, its time so many times, and no more; its
    processes as well."""
    if sys.platform == "win32":
        pytest.skip("Windows bounds no process")
    code = (
        f"import resource, sys; memory, seconds = {LIMITS[0]}, {times * LIMITS[1]}\n"
        "resource.setrlimit(resource.RLIMIT_AS, (memory, memory))\n"
        "resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))\n"
        f"sys.argv = {['bushfit', *arguments]}\n"
        "from bushfit.__main__ import main; main()"
    )
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, encoding="utf-8")
    return Done(done.returncode, done.stdout, done.stderr)


@pytest.fixture
def bombed(tmp_path) -> Path:
    for name, content in FILES.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "book.toml").write_text(FILES["campaign.toml"].replace("loop.csv", "book.xlsx"))
    return tmp_path


def test_a_workbook_with_a_forgotten_cell_far_away(bombed):
    (bombed / "book.xlsx").write_bytes(
        workbook(['</sheetData><dimension ref="A1:XFD1048576"/><sheetData>' + far_apart()])
    )
    done = bounded(bombed, "fit", "book.toml", "-o", "x")
    refused(done, bombed / "x", "of book.toml: the workbook is too large", "save the")


def test_a_packed_file_whose_content_is_too_large(bombed):
    (bombed / "zeros.csv.gz").write_bytes(17 * gzip.compress(bytes(1 << 26)))
    refused(bounded(bombed, "inspect", "zeros.csv.gz", "-o", "x"), bombed / "x", "file is too large", "when unpacked")


@pytest.fixture
def long_runs(bombed) -> Path:
    """Two runs of 12,000 points: what grew with the square of them took 1.2 GB for each matrix."""
    rng = np.random.default_rng(1)
    frequency, level = np.tile(np.linspace(1.0, 200.0, 12_000), 2), np.repeat([0.1, 0.2], 12_000)
    reached = level * np.exp(0.001 * rng.standard_normal(level.size))
    stiffness = 500.0 + 0.6 * frequency + rng.standard_normal(level.size)
    columns = (frequency, reached, stiffness, 0.1 + 0.002 * rng.standard_normal(level.size))
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    (bombed / "sweep.csv").write_text("\n".join([FILES["sweep.csv"].partition("\n")[0], *rows]))
    return bombed


def test_a_fit_to_runs_of_12_000_points(long_runs):
    done = bounded(long_runs, "fit-dynamic", "campaign.toml", "--static", "model.json", "-o", "x", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert json.loads((long_runs / "x" / "dynamic.json").read_text())["fit"]["points"] == 2 * 12_000


def loop(points_a_cycle: int = 100, header: str = "time [s],displacement [mm],force [N]", tail: str = "") -> str:
    """Three cycles of 1 mm."""
    phase = 2.0 * np.pi * (np.arange(3 * points_a_cycle + 1) + 0.37) / points_a_cycle
    rows = [f"{p:.5f},{np.sin(p):.6f},{100 * np.sin(p) + 8 * np.cos(p):.5f}{tail}" for p in phase]
    return "\n".join([header, *rows]) + "\n"


@pytest.mark.parametrize(
    "more", ["", "header_line = 2\n", 'encoding = "utf-16"\n', 'columns = { force = "TOP" }\n', 'sheet = "x"\n']
)
def test_a_message_shows_nothing_of_a_file_that_is_no_test(typed, tmp_path, more):
    (tmp_path / ".env").write_text(SECRET)
    (tmp_path / "c.toml").write_text(BUSHING + LOOP.format(".env") + more)
    for command in (("fit", "c.toml"), ("predict", ".env"), ("batch", "c.toml", "--jobs", "1")):
        done = typed(*command, "-o", "x", "--no-plots", status=1 if command[0] == "batch" else 2)
        assert "TOPSECRET" not in done.stderr + "".join(file.read_text() for file in tmp_path.glob("x/batch.*"))


def test_data_that_are_in_another_file_are_not_read(typed, tmp_path):
    h5py = pytest.importorskip("h5py")
    (tmp_path / "secret.bin").write_bytes(b"TOPSECRET" * 1000)
    with h5py.File(tmp_path / "axial.mat", "w", userblock_size=512) as file:
        file["time"] = file["displacement"] = np.arange(100.0)
        file.create_dataset("force", shape=(100,), dtype="f8", external=[("secret.bin", 0, 800)])
    with (tmp_path / "axial.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")
    done = typed("inspect", "axial.mat", "--no-plots", "-o", "x", status=2)
    refused(done, tmp_path / "x", "its data are in other files")


def test_a_name_is_printed_as_it_is(typed, tmp_path):
    (tmp_path / "loop.csv").write_text(loop())
    text = BUSHING.replace('name = "B"', 'name = "a :smile: [red]b"') + LOOP.format("loop.csv")
    (tmp_path / "c.toml").write_text(text)
    assert "a :smile: [red]b: static fit" in typed("fit-static", "c.toml", "-o", "x", "--no-plots").stdout
