"""Result files: names and formats; the folder they go to, and files that are never replaced."""

import io
import os
import signal
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any, get_args
from xml.etree import ElementTree

import openpyxl
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from bushfit.campaign.campaign import load_campaign
from bushfit.commands.compare import compare, compared_result
from bushfit.commands.fit import fit
from bushfit.commands.predict import predict
from bushfit.errors import CONTROL, OutputError
from bushfit.geometry import Specimen
from bushfit.report.plots.style import to_image
from bushfit.report.results import Formats, Picture, ResultFile, encode_all, place_names, write_results

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are forked and killed")

OLD = {"a.csv": b"old a", "b.json": b"old b"}
NEW = {"a.csv": b"new a", "b.json": b"new b"}
#: A text with markup, the end of a comment, what mathematics would be, and letters that the font lacks.
NASTY = "<script>alert(1)</script> --> & $x_1$ 衬套"
#: A formula, mathematics that is none, and in names of files what clears the screen and turns a line around.
NAME = r"=cmd|' /C calc'!A0 $\foo{x}$ _a_ <b>"
FILE = "=1+1 $\\foo$ \x1b[2J\u202ecsv.exe"


def write(folder: Path, files: dict[str, bytes], *, force: bool = False, inputs: tuple[Path, ...] = ()) -> None:
    write_results(
        folder, [ResultFile(name, "raw", content) for name, content in files.items()], overwrite=force, inputs=inputs
    )


def contents(folder: Path) -> dict[str, bytes]:
    """Files of a folder but for the record."""
    return {file.name: file.read_bytes() for file in folder.glob("[!.]*")}


def test_a_killed_command_leaves_each_file_old_or_new_and_the_next_one_replaces_them(tmp_path):
    """Killed at every system call in turn: no file is torn, and none of them is taken for the user's."""
    states = set()
    for count in range(200):
        folder = tmp_path / str(count)
        write(folder, OLD)
        status = _killed_at(count, folder)
        found = contents(folder)
        assert all(found[name] in (OLD[name], NEW[name]) for name in OLD), count
        states.add(tuple(found.values()))
        write(folder, NEW, force=True)
        assert contents(folder) == NEW
        if status == 0:
            break
    assert len(states) >= 3


def _killed_at(count: int, folder: Path) -> int:
    """Exit status of a process that writes the new files and is killed at a system call."""
    child = os.fork()
    if not child:
        left = [count]

        def fault(event: str, _: Any) -> None:
            if event.startswith(("open", "os.")):
                left[0] -= 1
                if left[0] == -1:  # the kill is announced, too
                    os.kill(os.getpid(), signal.SIGKILL)

        try:
            sys.addaudithook(fault)
            write(folder, NEW, force=True)
            os._exit(0)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_a_folder_that_allows_no_writing():
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
                write(folder, NEW, force=True)
            except OutputError as error:
                status = 0 if "no permission to write there" in str(error) else 2
            os._exit(status)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert contents(folder) == {}


def test_commands_that_write_into_one_folder_lose_no_file(tmp_path):
    """Eight at once: the files of all of them are there, whole and known as results."""
    sets = [{f"{number}.csv": b"%d" % number * 2000, "shared.csv": b"%d" % number * 2000} for number in range(8)]
    write(tmp_path / "x", {"shared.csv": b"first"})
    threads = [threading.Thread(target=write, args=(tmp_path / "x", files), kwargs={"force": True}) for files in sets]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = contents(tmp_path / "x")
    assert found.pop("shared.csv") in [files["shared.csv"] for files in sets]
    assert found == {name: content for files in sets for name, content in files.items() if name != "shared.csv"}
    write(tmp_path / "x", dict.fromkeys((*found, "shared.csv"), b"again"), force=True)


@pytest.mark.parametrize("force", [True, False])
def test_a_file_that_bushfit_did_not_write_is_never_replaced(tmp_path, force):
    """One of the user's, a result that the user changed, a link, an input of the run, a folder, a file as folder."""
    (tmp_path / "results").mkdir()
    write(tmp_path / "results", OLD)
    (tmp_path / "results" / "a.csv").write_bytes(b"changed")
    (tmp_path / "results" / "c.csv").write_bytes(b"mine")
    (tmp_path / "results" / "d.csv").symlink_to("b.json")
    (tmp_path / "results" / "e.csv").mkdir()
    for name in ("a.csv", "c.csv", "d.csv", "e.csv"):
        with pytest.raises(OutputError) as refused:
            write(tmp_path / "results", {"new.csv": b"1", name: b"2"}, force=force)
        assert name in str(refused.value)
        assert "--force" not in str(refused.value), "the hint would not help"
    with pytest.raises(OutputError, match="input of this run"):
        write(tmp_path / "results", {"b.json": b"2"}, force=force, inputs=(tmp_path / "results" / "d.csv",))
    for folder, problem in (("c.csv", "not a folder"), ("c.csv/below", "cannot be written")):
        with pytest.raises(OutputError, match=problem):
            write(tmp_path / "results" / folder, NEW, force=force)
    names = {path.name for path in (tmp_path / "results").glob("[!.]*")}
    assert names == {"a.csv", "b.json", "c.csv", "d.csv", "e.csv"}
    assert (tmp_path / "results" / "b.json").read_bytes() == b"old b"


def test_names_of_files_differ_by_more_than_capitals():
    places = [Specimen(name, "modulus") for name in ("Mount", "mount", "coupon")]
    assert place_names(places) == ["Mount", "mount_2", "coupon"]


def drawn() -> Figure:
    figure = Figure()
    figure.subplots().fill_between([1.0, 2.0], [1.0, 2.0], [2.0, 3.0], hatch="//")
    figure.suptitle(NASTY, parse_math=False)
    return figure


@pytest.mark.parametrize("form", get_args(Picture))
def test_a_picture_is_the_same_bytes_each_time_without_date_or_version(form):
    first, second = (to_image(drawn(), form) for _ in range(2))
    assert first == second
    assert not [word for word in (b"Matplotlib v", b"CreationDate", b"dc:date", b"Software") if word in first]
    if form == "svg":  # texts are outlines
        names = {element.tag.partition("}")[2] for element in ElementTree.fromstring(first).iter()}
        assert {"path", "use"} <= names
        assert not {"script", "text", "image"} & names


@pytest.fixture(scope="module")
def outputs(root, tmp_path_factory) -> dict[str, list[ResultFile]]:
    """Result files of commands on a campaign of such names."""
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
    fitted = fit(campaign)
    return {
        "fit": [*fitted.files],
        "predict": [*predict(fitted, campaign).files],
        "compare": [*compare(*(compared_result(fitted, name) for name in (FILE, NAME))).files],
    }


@pytest.mark.parametrize("command", ["fit", "predict", "compare"])
def test_pictures_and_sheets(command, outputs):
    files, texts, cells = outputs[command], list[str](), list[Any]()
    for file in (file for file in files if file.kind == "figure"):
        figure = file.content()
        to_image(figure)
        drawn = figure.findobj(Text)
        assert not [text.get_text() for text in drawn if text._preprocess_math(text.get_text())[1]], "mathematics"
        texts += [text.get_text() for text in drawn]
    for name, content in encode_all(files, Formats(pictures=False, table_form="xlsx")).items():
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
