"""Any bytes are a table, a campaign or a model file, or one clear error: the fuzzer's corpus, hypothesis, and bombs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from targets import CORPUS, TARGETS, ready
from tries import some

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import BushfitError
from bushfit.model.file import load_result

#: Tries at most of what takes longer: workbooks are read in a process of their own, and a plan is a search.
MOST = {"workbook": 15, "report": 60, "plan": 20}
each_target = pytest.mark.parametrize("name", TARGETS)
#: What a commit tries: what takes longer waits.
most_targets = pytest.mark.parametrize("name", some(TARGETS, {*TARGETS} - {"workbook", "plan"}))


def kept(name: str) -> list[bytes]:
    return [file.read_bytes() for file in sorted((CORPUS / name).iterdir())]


@most_targets
def test_the_corpus(name: str) -> None:
    run, inputs = ready(name), kept(name)
    assert len(inputs) >= 10
    for data in inputs:
        run(data)


@each_target
def test_every_seed_has_a_name(name: str) -> None:
    """Words and an ending, as in `key_twice.json`; the fuzzer itself names inputs by their checksum."""
    names = [file.name for file in (CORPUS / name).iterdir()]
    assert [name for name in names if not re.fullmatch(r"[a-z]\w*\.(csv|toml|json|xml|txt)", name)] == []


@st.composite
def mutated(draw: st.DrawFn, originals: list[bytes]) -> bytes:
    """A file of the corpus with some pieces removed, doubled, reversed or replaced."""
    data = draw(st.sampled_from(originals))
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(data)))
        end = draw(st.integers(begin, len(data)))
        piece = data[begin:end]
        others = [b"", piece * 2, piece[::-1], b"\0", b'"', b",", b"[", b"9" * 400, b"-", b"nan", b"\xff\xfe", b"1e999"]
        data = (data[:begin] + draw(st.sampled_from(others) | st.binary(max_size=8)) + data[end:])[:20_000]
    return data


ANY = st.binary(max_size=300) | st.text(max_size=300).map(lambda text: text.encode("utf-8", "surrogatepass"))


@pytest.mark.hypothesis
@pytest.mark.parametrize("mutates", [False, True], ids=["any bytes", "mutated files"])
@most_targets
def test_whatever_the_bytes(name: str, mutates: bool) -> None:
    run = ready(name)

    @settings(max_examples=min(MOST.get(name, 1000), settings.default.max_examples))
    @given(mutated(kept(name)) if mutates else ANY)
    def check(data: bytes) -> None:
        run(data)

    check()


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
