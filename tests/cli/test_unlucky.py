"""Unlucky files, folders and machines: one clear error or a result, soon, and nothing of a file that is no test."""

import numpy as np
import pytest
from shell import BUSHING, refused

LOOP = '[[loops]]\nfile = "{}"\ndirection = "axial"\n'
SECRET = 'url = https://user:TOPSECRET@host\n\tTOPSECRET = "more"\n' * 3


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
    assert "a :smile: [red]b: static fit" in typed("fit-static", "c.toml", "-o", "x", "--no-plots").stderr
