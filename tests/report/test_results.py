"""Results whole or absent, never mixed, never over others unasked; tables and pictures named before they are made."""

from __future__ import annotations

import io
import json
import os
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args
from xml.etree import ElementTree

import numpy as np
import openpyxl
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import CONTROL, OutputError
from bushfit.fitting.data import Data
from bushfit.jobs.compare import Compare
from bushfit.jobs.fits import Fit
from bushfit.jobs.predict import Predict
from bushfit.model.model import Model
from bushfit.reading.tablefile import Form
from bushfit.report import folder as results
from bushfit.report.contents import Contents, Formats, Picture
from bushfit.report.folder import write_files
from bushfit.report.plots.style import to_image
from bushfit.report.tables import loops_table, sweeps_table

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are forked and killed")

HERE = Path(__file__).parent
OLD = {"a.csv": b"old a", "b.json": b"old b"}
NEW = {"a.csv": b"new a", "b.json": b"new b"}


def script(name: str, *arguments: str) -> dict[str, int]:
    done = subprocess.run(
        [sys.executable, str(HERE / name), *arguments], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout.strip())
    return json.loads(done.stdout)


def exchange_works(folder: Path) -> bool:
    one, other = folder / "one", folder / "other"
    one.mkdir()
    other.mkdir()
    try:
        results.exchange(one, other)
    except OSError:
        return False
    return True


@pytest.mark.parametrize("how", ["killed", "full"])
@pytest.mark.parametrize("where", ["new", "exchanged", "inside"])
def test_stopped_at_every_system_call(where: str, how: str, tmp_path: Path) -> None:
    """Every state is whole. Inside the folder where the user stands nothing can be exchanged, and what was decided is
    ended by the next run."""
    seen = script("interrupt.py", str(tmp_path / "results" / "x"), where, how)["seen"]
    states = {state.split(",")[0] for state in seen}
    allowed = {"new": {"absent", "new"}, "exchanged": {"old", "new"}, "inside": {"old", "new", "decided"}}[where]
    if where == "exchanged" and not exchange_works(tmp_path):
        allowed.add("decided")
    assert states <= allowed
    assert len(states) >= 2


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 KiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        done = subprocess.run(mounting, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        pytest.skip(f"no disk can be mounted here: {error}")
    if done.returncode:
        pytest.skip(f"no disk may be mounted here: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize(
    ("mounted", "size", "says"),
    [("", 90_000, "No space left"), ("remount,ro", 10, "no right to write there")],
    ids=["full", "read only"],
)
def test_a_disk_that_is_full_or_may_only_be_read(small_disk: Path, mounted: str, size: int, says: str) -> None:
    write_files(small_disk / "x", OLD, force=False)
    if mounted:
        subprocess.run(["mount", "-o", mounted, str(small_disk)], check=True)
    for place in (small_disk / "y", small_disk / "x"):
        with pytest.raises(OutputError, match=says):
            write_files(place, {"a.csv": bytes(size // 3), "b.json": bytes(2 * size // 3)}, force=True)
    assert [path.name for path in small_disk.iterdir()] == ["x"]
    assert contents(small_disk / "x") == OLD


def test_a_folder_that_allows_no_writing() -> None:
    """Rights do not bind root, so that a child gives its own up first."""
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home) / "x"
        folder.mkdir()
        folder.chmod(0o555)
        Path(home).chmod(0o755)
        child = os.fork()
        if not child:
            status = 1
            if os.getuid() == 0:
                os.setuid(65534)
            try:
                write_files(folder, NEW, force=True)
            except OutputError as error:
                status = 0 if "no right to write there" in str(error) else 2
            os._exit(status)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert contents(folder) == {}


def test_files_are_flushed_one_by_one_where_the_system_knows_no_other_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[int] = []
    monkeypatch.setattr(results, "_libc", lambda: None)
    monkeypatch.setattr(os, "fsync", flushed.append)
    write_files(tmp_path / "x", OLD, force=False)
    write_files(tmp_path / "x", NEW, force=True)  # nor can folders be exchanged there
    assert len(flushed) == 4
    assert contents(tmp_path / "x") == NEW
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


@pytest.mark.parametrize("force", [True, False])
def test_runs_into_one_folder_at_a_time(tmp_path: Path, force: bool) -> None:
    """Whole sets: with --force the last one stands, without it the first, and each other one is told."""
    sets = [dict.fromkeys("abcdefgh", b"%d" % number * 2000) for number in range(8)]
    refused: list[OutputError] = []

    def write(files: dict[str, bytes]) -> None:
        try:
            write_files(tmp_path / "x", files, force=force)
        except OutputError as error:
            refused.append(error)

    threads = [threading.Thread(target=write, args=(files,)) for files in sets]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert contents(tmp_path / "x") in sets
    assert len(refused) == (0 if force else 7)
    assert all("results stand there already" in str(error) for error in refused)
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_what_a_killed_run_left_is_removed_but_not_what_another_run_is_at(tmp_path: Path) -> None:
    left, at_work, of_the_user = (tmp_path / name for name in (".bushfit-abcdefgh", ".bushfit-ijklmnop", ".bushfit-x"))
    for folder in (left, at_work, of_the_user):
        (folder / "new").mkdir(parents=True)
    claim = results.claim(at_work)
    write_files(tmp_path / "x", NEW, force=False)
    claim.close()
    assert {path.name for path in tmp_path.iterdir()} == {"x", at_work.name, of_the_user.name}


FILES = {"a.csv": b"1\n", "b.json": b"{}\n"}


def contents(folder: Path, pattern: str = "*") -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob(pattern)}


def test_a_new_folder_is_made_and_one_that_stands_keeps_rights_subfolders_and_links(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "deep" / "x"
    write_files(folder, FILES, force=False)
    assert contents(folder) == FILES
    assert [child.name for child in folder.parent.iterdir()] == ["x"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o777 & ~umask
    folder = tmp_path / "x"
    (folder / "sub" / "deep").mkdir(parents=True)
    (folder / "sub" / "deep" / "mine.txt").write_text("mine")
    (folder / "link").symlink_to("nowhere")
    folder.chmod(0o750)
    (tmp_path / "way").symlink_to(folder, target_is_directory=True)
    write_files(folder, OLD, force=False)
    write_files(tmp_path / "way", NEW, force=True)
    assert (tmp_path / "way").is_symlink()
    assert (folder / "a.csv").read_bytes() == b"new a"
    assert (folder / "sub" / "deep" / "mine.txt").read_text() == "mine"
    assert (folder / "link").readlink() == Path("nowhere")
    assert folder.stat().st_mode & 0o777 == 0o750


def test_a_file_in_the_way_stops_and_force_takes_away_what_the_same_command_wrote(tmp_path: Path) -> None:
    """Not what another wrote, what somebody has changed since, or what stands there besides."""
    folder = tmp_path / "x"
    for names, by in (("abc", "one"), ("de", "other"), ("fg", "one")):
        write_files(folder, {f"{name}.csv": b"1" for name in names}, force=False, by=by)
    assert set(contents(folder, "[!.]*")) == {f"{letter}.csv" for letter in "abcdefg"}
    (folder / "b.csv").write_bytes(b"mine")
    (folder / "notes.txt").write_bytes(b"mine")
    write_files(folder, {"c.csv": b"2", "d.csv": b"2"}, force=True, by="one")
    new = {"c.csv": b"2", "d.csv": b"2", "e.csv": b"1"}
    assert contents(folder, "[!.]*") == {"b.csv": b"mine", "notes.txt": b"mine", **new}
    write_files(folder, {"h.csv": b"1"}, force=True, by="one")
    assert set(contents(folder, "[!.]*")) == {"b.csv", "e.csv", "h.csv", "notes.txt"}
    (tmp_path / "file").write_text("a file")
    (tmp_path / "y" / "a.csv").mkdir(parents=True)
    for folder, says in (
        ("file", "not a folder"),
        ("file/below", "cannot be written"),
        ("y", "a folder stands where a file goes"),
    ):
        for force in (True, False):
            with pytest.raises(OutputError, match=says):
                write_files(tmp_path / folder, FILES, force=force)
    assert (tmp_path / "file").read_text() == "a file"
    assert list((tmp_path / "y").iterdir()) == [tmp_path / "y" / "a.csv"]


@pytest.mark.parametrize(
    "record",
    [b"", b"[]", b"\xff", b'{"written": {"one": {"../mine.txt": 3}}, "removed": ["../mine.txt"]}', b"[" * 100_000],
)
def test_a_record_that_is_spoiled_removes_nothing(record: bytes, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    (tmp_path / "mine.txt").write_bytes(b"mine")
    write_files(folder, {"a.csv": b"1", "b.csv": b"1"}, force=False, by="one")
    (folder / ".bushfit.json").write_bytes(record)
    write_files(folder, {"b.csv": b"2"}, force=True, by="one")
    assert set(contents(folder, "[!.]*")) == {"a.csv", "b.csv"}
    assert (tmp_path / "mine.txt").read_bytes() == b"mine"


BEGINS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
#: A text with markup, the end of a comment, what mathematics would be, and letters that the font lacks.
NASTY = "<script>alert(1)</script> --> & $x_1$ 衬套"


@pytest.fixture(scope="module")
def data(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


def drawn() -> Figure:
    figure = Figure()
    figure.subplots().fill_between([1.0, 2.0], [1.0, 2.0], [2.0, 3.0], hatch="//")
    figure.suptitle(NASTY, parse_math=False)
    return figure


@pytest.mark.parametrize(("form", "end"), [("csv", "csv"), ("decimal-comma", "csv"), ("xlsx", "xlsx")])
@pytest.mark.parametrize("pictures", [("png",), ("svg", "pdf"), ()])
def test_files_have_the_names_told_before(form: Form, end: str, pictures: tuple[Picture, ...]) -> None:
    made = list[Figure]()

    def picture() -> Figure:
        made.append(drawn())
        return made[0]

    formats = Formats(pictures=bool(pictures), table_form=form, picture_forms=pictures)
    table = pd.DataFrame({"x [mm]": np.ones(2)})
    contents = Contents({"model": {}}, {"a": lambda: table, "b": lambda: table}, {"b": picture})
    files = formats.files(contents)
    assert list(files) == formats.names(contents.kinds)
    assert list(files) == ["model.json", f"a.{end}", f"b.{end}", *(f"b.{each}" for each in pictures)]
    assert len(made) == bool(pictures), "drawn once for all forms"
    for each in pictures:
        assert files[f"b.{each}"].startswith(BEGINS[each])


@pytest.mark.parametrize("form", get_args(Picture))
def test_a_picture_is_the_same_bytes_each_time_without_date_or_version(form: Picture) -> None:
    first, second = (to_image(drawn(), form) for _ in range(2))
    assert first == second
    assert not [word for word in (b"Matplotlib v", b"CreationDate", b"dc:date", b"Software") if word in first]
    if form == "svg":  # texts are outlines
        names = {element.tag.partition("}")[2] for element in ElementTree.fromstring(first).iter()}
        assert {"path", "use"} <= names
        assert not {"script", "text", "image"} & names


def test_loops_row_by_row_and_sweeps_by_amplitude_repeat_and_frequency(data: Data, paper_model: Model) -> None:
    table, loop = loops_table(paper_model, data.loops), data.loops[0].test
    assert len(table) == loop.time.size
    np.testing.assert_allclose(table["force [N]"], loop.force, rtol=1e-12)
    np.testing.assert_allclose(table["displacement [mm]"], 1e3 * loop.displacement, atol=2e-3)
    off = (table["model force [N]"] - table["force [N]"]) / data.loops[0].drive.noise
    np.testing.assert_allclose(table["residual [noise]"], off, rtol=1e-9, atol=1e-9)
    assert np.std(table["residual [noise]"]) == pytest.approx(1.0, abs=0.1)
    table = sweeps_table(paper_model, data.sweeps)
    assert len(table) == sum(data_set.sweep.frequency.size for data_set in data.sweeps)
    assert list(dict.fromkeys(table["direction"])) == ["axial", "radial"]
    axial = table[table["direction"] == "axial"].reset_index(drop=True)
    frequency, amplitude = axial[["frequency [Hz]", "amplitude [mm]"]].to_numpy().T
    assert axial.equals(axial.sort_values(["amplitude [mm]", "repeat", "frequency [Hz]"], ignore_index=True))
    stiffness = paper_model.stiffness("axial", frequency, amplitude / 1e3)
    np.testing.assert_allclose(axial["model stiffness [N/mm]"], np.abs(stiffness) / 1e3, rtol=1e-12)
    np.testing.assert_allclose(axial["model loss factor [-]"], stiffness.imag / stiffness.real, rtol=1e-9)


#: A formula, mathematics that is none, and in names of files what clears the screen and turns a line around.
NAME = r"=cmd|' /C calc'!A0 $\foo{x}$ _a_ <b>"
FILE = "=1+1 $\\foo$ \x1b[2J\u202ecsv.exe"


@pytest.fixture(scope="module")
def found(root: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Contents]:
    """All that commands make of a campaign of such names."""
    folder = tmp_path_factory.mktemp("foreign")
    text = (root / "configs/cmp_15961.toml").read_text().replace('"CMP 15 961"', f"'''{NAME}'''", 1)
    for number, file in enumerate(sorted((root / "data/cmp_15961").glob("*.csv"))):
        name = f"{FILE}{number}.csv"
        (folder / name).write_bytes(file.read_bytes())
        quoted = name.replace("\\", "\\\\").replace("\x1b", "\\u001b")
        text = text.replace(f'"../data/cmp_15961/{file.name}"', f'"{quoted}"')
    assert "../data" not in text
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    campaign = load_campaign(folder / "campaign.toml")
    fitted = Fit().run(Data.of(campaign))
    job = Compare()
    compared = job.run([job.entry(fitted.result, FILE), job.entry(fitted.result, NAME)])
    return {
        "fit": fitted.contents,
        "predict": Predict().run(fitted.result, campaign).contents_beside,
        "compare": compared.contents,
    }


@pytest.mark.parametrize("command", ["fit", "predict", "compare"])
def test_pictures_and_sheets(command: str, found: dict[str, Contents]) -> None:
    contents, texts, cells = found[command], list[str](), list[Any]()
    for make in contents.pictures.values():
        figure = make()
        to_image(figure)
        drawn = figure.findobj(Text)
        assert not [text.get_text() for text in drawn if text._preprocess_math(text.get_text())[1]], "mathematics"
        texts += [text.get_text() for text in drawn]
    for name, content in Formats(pictures=False, table_form="xlsx").files(contents).items():
        if name.endswith("xlsx"):
            book = openpyxl.load_workbook(io.BytesIO(content))
            cells += [cell for sheet in book for row in sheet.iter_rows() for cell in row]
        else:
            texts += content.decode().split("\n")
    assert not [cell.value for cell in cells if cell.data_type == "f" or cell.hyperlink]
    texts += [str(cell.value) for cell in cells]
    assert not [text for text in texts if CONTROL.search(text.replace("\n", ""))]
    seen = [text for text in texts if "foo" in text]
    print(f"{len(texts)} texts, {len(seen)} with a foreign name")
    assert seen
