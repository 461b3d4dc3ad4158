"""Any bytes are a table, a campaign or a model file, or one clear error: kept inputs, and random ones."""

import shutil
from pathlib import Path

import bombs
import pytest
from mutations import INPUTS, LINES, faults, wrong_end
from tries import some

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import BushfitError
from bushfit.model.file import load_result

BUSHING = '[bushing]\nname = "x"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n'
CORPUS = Path(__file__).with_name("corpus")
#: Texts that cells of a workbook may name.
TEXTS = "".join(f"<si><t>{text}</t></si>" for text in ("time [s]", "displacement [mm]", "force [N]", "1,5"))
#: Campaigns of the bushing with one test in table.csv.
CAMPAIGNS = {
    f"{kind}.toml": f'{BUSHING}[[{kind}]]\nfile = "table.csv"\ndirection = "axial"\n'.encode()
    for kind in ("loops", "sweeps")
}
#: The file that an input of the corpus becomes, and the commands that read it; of a report its first line names it.
READ_BY = {
    "readers": ("table.csv", ["inspect", "reduce --mass 1kg --direction axial", *map("fit {}".format, CAMPAIGNS)]),
    "campaign": ("campaign.toml", ["fit"]),
    "model": ("model.json", ["predict"]),
    "workbook": ("table.xlsx", ["inspect", "inspect --sheet S2 --direction axial"]),
    "report": ("", ["report res", "compare res/model.json res/model.json"]),
}


def assert_clear(name: str, data: bytes, folder: Path) -> None:
    """The commands end right with an input, or with one clear error."""
    file, commands = READ_BY[name]
    tables = {table: (CORPUS / "readers" / table).read_bytes() for table in ("loop.csv", "sweep.csv")}
    files = tables | CAMPAIGNS | {key: text.encode() for key, text in INPUTS.items() if key.startswith("res/")}
    if name == "report":
        first, _, data = data.partition(b"\n")
        file = f"res/{first.decode('ascii', 'ignore')}"
        assert file in files
    if name == "workbook":
        data = bombs.workbook(data.split(b"\n====\n"), texts=f"<sst>{TEXTS}</sst>")
    for command in commands:
        program, *words = command.split()
        words = words if words and words[0][0] != "-" else [file, *words]
        plain = [] if program == "report" else ["--no-plots"]
        assert wrong_end([program, *words, "-o", "x", *plain], folder, files | {file: data}) == "", command
        shutil.rmtree(folder / "x", ignore_errors=True)


@pytest.mark.parametrize("name", some(READ_BY, {"model"}))
def test_the_corpus(name, tmp_path):
    """Inputs of which each once went wrong."""
    inputs = sorted((CORPUS / name).iterdir())
    assert len(inputs) >= 10
    for file in inputs:
        assert_clear(name, file.read_bytes(), tmp_path)


@pytest.mark.parametrize("command", some(LINES, {"predict", "inspect", "simulate", "export", "reduce"}))
def test_mutated_files_and_options(command, tmp_path):
    _, found = faults(command, range(15), tmp_path / "work")
    assert found == []


@pytest.mark.parametrize(("name", "load"), [("x.toml", load_campaign), ("x.json", load_result)])
def test_a_file_of_3_gib_is_not_even_read(name, load, tmp_path):
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(3 << 30)
    with pytest.raises(BushfitError, match="the file is too large"):
        load(tmp_path / name)  # type: ignore[operator]
