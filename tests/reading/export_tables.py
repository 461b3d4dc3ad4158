"""One sweep and one loop in numbers, and the tables and files in which laboratories write them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

FREQUENCY = np.tile([5.0, 10.0, 20.0, 40.0, 80.0], 2)
AMPLITUDE = np.repeat([0.1, 0.5], 5)
#: Stiffness of the sweep [N/mm], as all files state it in full.
STIFFNESS = (1500.0 + 2.0 * FREQUENCY - 400.0 * AMPLITUDE) * (1.0 + 1j * (0.1 + FREQUENCY / 1000.0))
ETA = STIFFNESS.imag / STIFFNESS.real
PHASE = np.degrees(np.angle(STIFFNESS))
DAMPING = STIFFNESS.imag / (2.0 * np.pi * FREQUENCY)
#: Three cycles of 1 mm at 0.1 Hz.
TIME = np.arange(600) * 0.05
DISPLACEMENT = np.sin(2.0 * np.pi * 0.1 * TIME)
FORCE = 1000.0 * np.sin(2.0 * np.pi * 0.1 * TIME + 0.1)
F, A, K = FREQUENCY, AMPLITUDE, np.abs(STIFFNESS)
USUAL = "Frequency [Hz]|Amplitude [mm]|K* [N/mm]|"
LOOP = "time [s],displacement [mm],force [N]".replace(",", "\t")
G = STIFFNESS / 200.0  # [MPa] at strains of 1 and 5 %
MODULUS = {"frequency": F, "amplitude": A / 10.0, "stiffness": 1e6 * G}
ONE_HZ = {"frequency": 0 * F + 1.0, "amplitude": A / 10.0, "stiffness": 1e6 * G}
#: Force [N] with 20 times as much noise as loop.
NOISE = 0.05 * FORCE + 1000.0 * (-1.0) ** np.arange(TIME.size)
EXCEL_DAYS = TIME / 86_400.0 + 46_352.5


@dataclass(frozen=True)
class Export:
    """A file and what `inspect` makes of it.

    The kind is None if the file raises a question, and the words are those of the question or of the notes. The file
    needs the stated keys of a campaign. The reference has the columns of the test in SI; default those of this module.
    """

    content: str | bytes
    kind: str | None = "sweep"
    words: Sequence[str] = ()
    stated: dict[str, Any] = field(default_factory=dict)
    name: str = "export.txt"
    reference: dict[str, np.ndarray] | None = None


def table(headers: Sequence[str], *columns: Any, mark: str = "\t", form: str = "{:.9g}") -> list[str]:
    """Lines of a table; a column is an array, or a list of texts."""
    texts = [[cell if isinstance(cell, str) else form.format(cell) for cell in column] for column in columns]
    return [mark.join(headers), *(mark.join(row) for row in zip(*texts, strict=True))]


def sweep(headers: str, *columns: Any, mark: str = "\t", **other: Any) -> str:
    """A sweep whose headers are separated by "|"."""
    return "\n".join(table(headers.split("|"), *columns, mark=mark, **other)) + "\n"


def loop(headers: str = "time [s]|displacement [mm]|force [N]", *columns: Any, **other: Any) -> str:
    """A loop."""
    return sweep(headers, *(columns or (TIME, DISPLACEMENT, FORCE)), **other)


def blocks(title: Callable[[float], str], headers: str, mark: str = "\t", end: Sequence[str] = ()) -> str:
    """A block of a sweep for each amplitude, below its title."""
    lines = list[str]()
    for level in (0.1, 0.5):
        lines += [title(level), *table(headers.split("|"), *(x[level == A] for x in (F, K, ETA)), mark=mark), *end]
    return "\n".join(lines) + "\n"


def clock(seconds: float, form: str) -> str:
    """A time of day, from 20:07:10 on."""
    total = 72_430.0 + seconds
    hours, minutes = int(total // 3600), int(total % 3600 // 60)
    return form.format(h=hours, m=minutes, s=total % 60, h12=(hours - 1) % 12 + 1)


MTS793 = "\n".join(
    "\n".join(
        [
            f"Data Acquisition: Timed {n}\tTime: {20.0 + n:.3f}\tSec\t11/26/2026 8:07:1{n} PM",
            "Station Name: elastomer.cfg", "",
            *table(["Time", "Axial Displacement", "Axial Force"], ["Sec", *(f"{t:.3f}" for t in TIME)],
                   ["mm", *(f"{x:.6f}" for x in DISPLACEMENT)], ["N", *(f"{y:.4f}" for y in FORCE)]), "",
        ]
    )
    for n in range(3)
)  # fmt: skip
LVM = "\r\n".join(
    [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab", "Decimal_Separator\t.",
        "Multi_Headings\tYes", "X_Columns\tOne", "Time_Pref\tRelative", "Operator\tAB", "Date\t2026/11/26",
        "Time\t20:07:10.1234567890123", "***End_of_Header***\t", "\t", "Channels\t2\t", "Samples\t600\t600\t",
        "Date\t2026/11/26\t2026/11/26\t", "Time\t20:07:10\t20:07:10\t", "Y_Unit_Label\tmm\tN\t",
        "X_Dimension\tTime\tTime\t", "X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t",
        "Delta_X\t0.050000\t0.050000\t",
        "***End_of_Header***\t\t\t", "X_Value\tLVDT\tLoad Cell\tComment",
        *(f"{t:.6f}\t{x:.6f}\t{y:.6f}" for t, x, y in zip(TIME, DISPLACEMENT, FORCE, strict=True)), "",
    ]
)  # fmt: skip
LVM_NO_X = LVM.replace("X_Columns\tOne", "X_Columns\tNo")
LVM_NO_X = "\r\n".join(
    "\t" + line.partition("\t")[2] if line[:1].isdigit() else line for line in LVM_NO_X.split("\r\n")
)
RHEO = "\n".join(
    [
        "Project:\tEPDM", "Test:\tAmplitude sweep", "", "Interval and data points:\t1\t10",
        "Interval data:\tPoint No.\tAngular Frequency\tShear Strain\tStorage Modulus\tLoss Modulus"
        "\tSample\tWaveform Strain\tWaveform Stress",
        "\t\t[rad/s]\t[%]\t[Pa]\t[Pa]\t\t[%]\t[Pa]",
        *(
            line
            for n in range(10)
            for line in [
                f"\t{n + 1}\t{2 * np.pi * F[n]:.9g}\t{10 * A[n]:.9g}\t{1e6 * G[n].real:.9g}"
                f"\t{1e6 * G[n].imag:.9g}\t\t\t",
                *(f"\t\t\t\t\t\t{i}\t{np.sin(i):.4f}\t{1e3 * np.sin(i + 0.1):.4f}" for i in range(8)),
            ]
        ),
    ]
)  # fmt: skip
T10 = (
    "Frequency\tDynamic Displacement p-p\tK*\tTan Delta\tPhase\tC\tMean Load\n"
    "Hz\tmm\tN/mm\t\tdeg\tN-s/mm\tN\n" + "\n".join(table([], F, 2 * A, K, ETA, PHASE, DAMPING, 0 * F + 500.0)[1:])
)  # fmt: skip
