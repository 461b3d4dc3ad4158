"""Spoiled inputs, one a row: the command line, what was done to its files, and what the one error has to say."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import cycle
from typing import Any

import numpy as np
from shell import RUBBER
from spoiled_campaigns import IN_CAMPAIGN, IN_MORE, WHOLE_CAMPAIGNS
from spoiled_models import IN_MODEL, IN_PREDICTED, WHOLE_MODELS
from spoiled_tables import IN_LOOP, IN_RESONANCE, IN_SWEEP
from spoiled_usage import LIMITS, MANIFESTS, USAGE

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
READING = ("fit-static", "fit-dynamic", "fit", "diagnose", "run", "plan")
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
TAKING_MODELS = (
    ("predict", "model.json"), ("compare", "model.json", "campaign.toml"), ("simulate", "model.json"),
    ("plan", "model.json"), ("diagnose", "campaign.toml", "--model", "model.json"),
    ("fit-static", "campaign.toml", "--dynamic", "model.json"),
    ("fit-dynamic", "campaign.toml", "--static", "model.json"),
)  # fmt: skip


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


def campaigns() -> Iterator[Spoiled]:
    """A text of the campaign replaced by another; the commands in turn."""
    commands = cycle(READING)
    for old, new, *says in IN_CAMPAIGN:
        assert old in CAMPAIGN, old
        text = CAMPAIGN.replace(old, new, 1)
        name = f"{old.strip()} -> {new.strip()}"
        yield Spoiled(name, (next(commands), "campaign.toml"), tuple(says), {"campaign.toml": text})
    for old, new, *says in IN_MORE:
        assert old in MORE, old
        text = CAMPAIGN + MORE.replace(old, new, 1)
        command = "simulate" if MORE.index(old) > MORE.index("[simulate]") else next(commands)
        yield Spoiled(f"{old.strip()} -> {new.strip()}", (command, "more.toml"), tuple(says), {"more.toml": text})
    for name, content, *says in WHOLE_CAMPAIGNS:
        yield Spoiled(name, (next(commands), "campaign.toml"), tuple(says), {"campaign.toml": content})


def models() -> Iterator[Spoiled]:
    """One entry of the model file changed; the commands that take a model in turn, and export each."""
    commands = cycle(TAKING_MODELS)
    for rows, taking in ((IN_MODEL, commands), (IN_PREDICTED, cycle(TAKING_MODELS[:1]))):
        for name, change, *says in rows:
            document = json.loads(json.dumps(MODEL))
            change(document)
            yield from given(name, next(taking), says, json.dumps(document))
    for name, content, *says in WHOLE_MODELS:
        yield from given(name, next(commands), says, content)


def given(name: str, command: tuple[str, ...], says: Iterable[str], model: str | bytes | None) -> Iterator[Spoiled]:
    """A model file, to a command and to export."""
    yield Spoiled(name, command, tuple(says), {"model.json": model})
    yield Spoiled(f"export: {name}", EXPORT, tuple(says), {"model.json": model})


def tables() -> Iterator[Spoiled]:
    """Rows of the measured tables changed."""
    commands = cycle(READING)
    for name, change, *says in IN_LOOP:
        yield Spoiled(f"loop: {name}", (next(commands), "campaign.toml"), tuple(says), {"loop.csv": change(loop())})
    for name, change, *says in IN_SWEEP:
        yield Spoiled(f"sweep: {name}", (next(commands), "campaign.toml"), tuple(says), {"sweep.csv": change(sweep())})
    for name, change, *says in IN_RESONANCE:
        command = ("reduce", "shaker.csv", "--mass", "0.5 kg", "--direction", "axial")
        yield Spoiled(f"resonance: {name}", command, tuple(says), {"shaker.csv": change(shaker())})


def typed() -> Iterator[Spoiled]:
    """Command lines, and limits and manifests of a batch."""
    for command, *says in USAGE:
        yield Spoiled(command, tuple(command.split("|")), tuple(says))
    for text, *says in LIMITS:
        command = ("batch", "campaign*.toml", "--limits", "judge.toml")
        yield Spoiled(f"limits: {text}", command, tuple(says), {"judge.toml": text + "\n"})
    for name, text, *says in MANIFESTS:
        yield Spoiled(f"{name}: {text}", ("batch", name), (name, *says), {name: text})


ROWS = [*campaigns(), *models(), *typed(), *tables()]
