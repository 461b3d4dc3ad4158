"""Spoiled inputs, one a row: the command line, what was done to its files, and what the one error has to say."""

import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from shell import RUBBER

CAMPAIGN = """\
[bushing]
name = "Test bushing"
inner_radius = "10 mm"
outer_radius = "18 mm"
length = "34 mm"

[[loops]]
file = "loop.csv"
direction = "axial"

[[sweeps]]
file = "sweep.csv"
direction = "axial"
"""
#: As much again, for keys that the plain campaign does not use.
MORE = (
    """
[fit]
dynamic_amplitudes = ["0.1 mm"]
residuals = "complex"

[fit.mu]
value = "1.1 MPa"
min = "0.5 MPa"
max = "3 MPa"
vary = true

[predict]
frequencies = { start = "5 Hz", stop = "155 Hz", step = "10 Hz" }
amplitudes = ["0.1 mm"]
torsion_amplitudes = ["0.5 deg"]
directions = ["axial"]

[[specimens]]
name = "DMA"
kind = "modulus"

[simulate]
seed = 1
repeats = 3
noise = "0.5 %"
phase_error = "0.15 deg"

"""
    + RUBBER
    + """\

[simulate.effects.inertia]
mass = "0.1 kg"

[[simulate.loops]]
direction = "axial"
amplitude = "1 mm"
frequency = "0.1 Hz"

[[simulate.sweeps]]
direction = "axial"
amplitudes = ["0.1 mm"]
frequencies = ["5 Hz", "15 Hz"]

[[simulate.sweeps]]
specimen = "DMA"
amplitudes = ["0.1 %", "1 %", "5 %"]
frequencies = ["10 Hz"]
stepped = "amplitude"
reached = "2 %"

[[simulate.resonances]]
direction = "radial"
mass = "0.25 kg"
base_acceleration = "0.1 g"
frequencies = { start = "50 Hz", stop = "500 Hz", step = "10 Hz" }
"""
)
MODEL: dict[str, Any] = {
    "schema": "bushfit/model/1",
    "bushing": {"name": "Test bushing", "inner_radius_m": 0.01, "outer_radius_m": 0.018, "length_m": 0.034},
    "effects": ["elastic", "springpot", "friction"],
    "parameters": {
        "mu": {"value": 1.09e6, "unit": "Pa", "stderr": 1e3, "ci95": [1.088e6, 1.092e6], "vary": True},
        "m": {"value": 2e5, "unit": "Pa*s^alpha", "stderr": None, "ci95": None, "vary": False},
        "alpha": {"value": 0.24, "unit": "1", "stderr": None, "ci95": None, "vary": False},
        "sigma_fmax": {"value": 1.46e4, "unit": "Pa", "stderr": None, "ci95": None, "vary": False},
        "eps_half": {"value": 0.013, "unit": "1", "stderr": None, "ci95": None, "vary": False},
    },
    "covariance": {"names": ["mu"], "matrix": [[1e6]]},
    "fit": {
        "nrmse": 0.01, "reduced_chi_square": 1.0, "points": 99, "noise": 0.005,
        "frequency_Hz": [1, 9], "strain": [0.01, 0.1],
    },
    "warnings": [],
    "provenance": {"bushfit": "0.1.0", "inputs": [], "packages": {}},
}  # fmt: skip
#: The formats that are written without a compiler.
EXPORT = ("export", "model.json", *(f"--format={name}" for name in ("nastran", "abaqus", "adams", "csv", "xlsx")))


def loop(rows: int = 200) -> list[str]:
    phase = 2.0 * np.pi * np.arange(rows) / 100.0
    columns = (phase / (0.2 * np.pi), np.sin(phase), 450.0 * np.sin(phase + 0.1))
    rows = [f"{t:.3f},{d:.5f},{f:.3f}" for t, d, f in zip(*columns, strict=True)]
    return ["time [s],displacement [mm],force [N]", *rows]


def sweep() -> list[str]:
    rows = [f"{f},{a},{500 + f},0.1{f:03d}" for a in (0.1, 0.2) for f in range(5, 156, 30)]
    return ["frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]", *rows]


def shaker() -> list[str]:
    """A mass of 0.5 kg on a mount of 1 kN/mm on a shaker."""
    frequency = np.linspace(50.0, 400.0, 36)
    ratio = 1.0 / (1.0 - 0.5 * (2.0 * np.pi * frequency) ** 2 / (1e6 * (1.0 + 0.1j)))
    phase = np.degrees(np.angle(ratio))
    rows = [f"{f:g},0.1000,{abs(0.1 * t):.4f},{p:.2f}" for f, t, p in zip(frequency, ratio, phase, strict=True)]
    return ["frequency [Hz],base acceleration [g],mass acceleration [g],phase [deg]", *rows]


FILES = {
    "campaign.toml": CAMPAIGN, "more.toml": CAMPAIGN + MORE, "model.json": json.dumps(MODEL, indent=1),
    "loop.csv": "\n".join(loop()) + "\n", "sweep.csv": "\n".join(sweep()) + "\n",
    "shaker.csv": "\n".join(shaker()) + "\n", "book.XLSX": "PK\x03\x04",
}  # fmt: skip


@dataclass(frozen=True)
class Spoiled:
    """One spoiled input: a command line, the files that differ from FILES (None: not there), and what to say."""

    name: str
    command: tuple[str, ...]
    says: tuple[str, ...]
    files: dict[str, str | bytes | None] = field(default_factory=dict)

    @property
    def arguments(self) -> tuple[str, ...]:
        return (self.command[0], *(() if self.command[0] == "schema" else ("-o", "x")), *self.command[1:])


#: Inputs that are no text, or too long for a table of them: name, command, file, content, and what the error says.
UNWRITTEN: list[tuple[str, str, str, str | bytes, list[str]]] = [
    ("binary campaign", "run", "campaign.toml", b"\x89PNG\r\n\x1a\n\0\0", ["campaign.toml, line 3: the file is not UTF-8 text"]),
    ("campaign in latin-1", "fit", "campaign.toml", 'name = "Gummi für Tür"'.encode("latin-1"), [
        "campaign.toml, line 1: the file is not UTF-8 text", "iconv -f LATIN1 -t UTF-8 old > new",
    ]),
    ("campaign of 1 MB", "plan", "campaign.toml", CAMPAIGN + "#" * 1_000_001, ["campaign.toml: the file is too large"]),
    ("a key of many parts", "fit", "campaign.toml", ".".join("a" * 5000) + " = 1\n", ["campaign.toml, line 1: the tables are nested too deeply"]),
    ("deep lists", "fit", "campaign.toml", "a = " + "[" * 5000, ["campaign.toml: the tables are nested too deeply"]),
    ("name without end", "predict", "model.json", json.dumps(MODEL).replace("Test", "x" * 5000), ["bushing.name: this value is not understood", "at most 200"]),
    ("100 000 warnings", "predict", "model.json", json.dumps(MODEL | {"warnings": ["w"] * 100_000}), ["model.json, warnings: ", "at most 10000 items"]),
    ("a warning of 5 MB", "predict", "model.json", json.dumps(MODEL | {"warnings": ["w" * 5_000_000]}), ["warnings #1: ", "at most 10000 characters"]),
    ("an integer of many digits", "predict", "model.json", '{"schema": ' + "9" * 5000 + "}", ["model.json: this is not valid JSON"]),
    ("a model of 10 MB", "predict", "model.json", " " * 10_000_001 + "{}", ["model.json: the file is too large"]),
    ("binary loop", "fit", "loop.csv", b"\x00\x01\x02" * 100, ["loop.csv, line 1: this is not text", 'export it as "CSV UTF-8", or state encoding = "..."']),
    ("a workbook cut short", "fit", "loop.csv", b"PK\x03\x04" + b"x" * 100, ["loop.csv: the workbook cannot be read", "save it again as xlsx"]),
    ("zeros far behind the head", "fit", "loop.csv", FILES["loop.csv"].encode() * 40 + bytes(5), ["loop.csv, line ", "this is not text", "byte 0x00"]),
    ("zeros in a file of Latin letters", "fit", "loop.csv", (FILES["loop.csv"] + "\xe4\n").encode("latin-1") * 40 + b"1,2\x00,3\n", ["this is not text", "byte 0x00"]),
]  # fmt: skip


def listed() -> Iterator[Spoiled]:
    """The rows of the tables in tests/files/spoiled; what is wrong with a model is told by `export`, too."""
    for table in sorted((Path(__file__).parents[1] / "files" / "spoiled").iterdir()):
        for row in tomllib.loads(table.read_text(encoding="utf-8"))["rows"]:
            name, files = row.get("name", f"{row['command']} {row.get('new', '')}"), dict[str, str | bytes | None]()
            if "missing" in row:
                files[row["missing"]] = None
            elif "text" in row:
                files[row["file"]] = row["text"]
            elif "pattern" in row:
                files[row["file"]] = re.sub(row["pattern"], row["new"], FILES[row["file"]])
            elif "file" in row:
                assert row["old"] in FILES[row["file"]], row
                files[row["file"]] = FILES[row["file"]].replace(row["old"], row["new"], 1)
            yield Spoiled(name, tuple(row["command"].split("|")), tuple(row["says"]), files)
            if table.stem == "models":
                yield Spoiled(f"export: {name}", EXPORT, tuple(row["says"]), files)


ROWS = [
    *listed(),
    *(Spoiled(name, (command, file if file != "loop.csv" else "campaign.toml"), tuple(says), {file: content})
      for name, command, file, content, says in UNWRITTEN),
]  # fmt: skip
