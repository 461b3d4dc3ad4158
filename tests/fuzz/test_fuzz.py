"""Any bytes are a table, a campaign or a model file, or one clear error: kept inputs, random ones, and bombs."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mutations import LINES, faults
from targets import CORPUS, TARGETS, ready
from tries import some

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import BushfitError
from bushfit.model.file import load_result


@pytest.mark.parametrize("name", some(TARGETS, {*TARGETS} - {"workbook"}))
def test_the_corpus(name: str) -> None:
    """Inputs of which each once went wrong."""
    run, inputs = ready(name), [file.read_bytes() for file in sorted((CORPUS / name).iterdir())]
    assert len(inputs) >= 10
    for data in inputs:
        run(data)


@pytest.mark.hypothesis
@pytest.mark.parametrize("name", ["readers", "campaign", "model"])
def test_whatever_the_bytes(name: str) -> None:
    run = ready(name)

    @given(st.binary(max_size=300) | st.text(max_size=300).map(lambda text: text.encode("utf-8", "surrogatepass")))
    def check(data: bytes) -> None:
        run(data)

    check()


@pytest.mark.parametrize("command", some(LINES, {"predict", "inspect", "simulate", "export", "reduce"}))
def test_mutated_files_and_options(command: str, tmp_path: Path) -> None:
    _, found = faults(command, range(40), tmp_path / "work")
    assert found == []


BUSHING = '[bushing]\nname = "x"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n'
#: Each took minutes or gigabytes in a parser that is not told to stop.
BOMBS = {
    "a key of 400 000 parts.toml": "[" + ".".join("a" * 400_000) + "]",
    "a quoted key of 200 000 parts.toml": ".".join(['"a"'] * 200_000) + " = 1",
    "half a million brackets.toml": "a = " + "[" * 500_000,
    "300 000 tables in one line.toml": "a = " + "{ a = " * 150_000,
    "a number of 900 000 digits.toml": BUSHING + "a = " + "9" * 900_000,
    "190 000 wrong values.toml": BUSHING + "[predict]\nfrequencies = [" + '"5",' * 190_000 + "]",
    "five million brackets.json": "[" * 5_000_000,
    "a million objects.json": '{"a":' * 1_000_000,
    "a number of nine million digits.json": '{"schema": ' + "9" * 9_000_000 + "}",
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(BOMBS[name])
    with pytest.raises(BushfitError):
        (load_result if name.endswith("json") else load_campaign)(tmp_path / name)


@pytest.mark.parametrize(("name", "load"), [("x.toml", load_campaign), ("x.json", load_result)])
def test_a_file_of_3_gib_is_not_even_read(name: str, load: object, tmp_path: Path) -> None:
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(3 << 30)
    with pytest.raises(BushfitError, match="the file is too large"):
        load(tmp_path / name)  # type: ignore[operator]
