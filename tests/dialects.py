"""One loop, one sweep, and one sweep of a coupon, in the dialects of test machines, spreadsheets and scripts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Literal

import numpy as np

from bushfit.reading.measurement import Floats

Kind = Literal["loop", "sweep", "coupon"]

_PHASE = np.linspace(0.0, 4.0 * np.pi, 60)
#: time [s], displacement [mm], force [N]; frequency [Hz], amplitude [mm], stiffness [N/mm], loss factor [-]; frequency
#: [Hz], strain [%], storage modulus [MPa], loss modulus [MPa].
NUMBERS: dict[Kind, list[list[Decimal]]] = {
    "loop": [
        [Decimal(f"{20.0 + 100.0 * p:.3f}"), Decimal(f"{2 * np.sin(p):.4f}"), Decimal(f"{12000 * np.sin(p + 0.1):.2f}")]
        for p in _PHASE
    ],
    "sweep": [
        [Decimal(f), Decimal(a), Decimal(f"{2345.125 + 7 * f - 900 * float(a):.3f}"), Decimal(f"{0.1 + f / 5e3:.4f}")]
        for a in ("0.1", "0.2", "0.5")
        for f in (5, 15, 25, 35, 45, 55)
    ],
    "coupon": [
        [Decimal(f), Decimal(e), Decimal(f"{5.125 + f / 50 - float(e):.3f}"), Decimal(f"{0.4 + f / 500:.4f}")]
        for e in ("0.05", "0.15", "1.25")
        for f in (1, 2, 5, 10, 20, 50)
    ],
}
MACHINE = ["Instrument: EL-7 Nº 3", "Operator{0}A. B.", "Date{0}2026-01-01", "Speed{0}10{0}mm/min", ""]


def expected(kind: Kind) -> list[Floats]:
    """The columns of a kind of test, each (n,), in the units of its file."""
    return [np.array([float(cell) for cell in column]) for column in zip(*NUMBERS[kind], strict=True)]


HEADERS: dict[str, dict[Kind, str]] = {
    "english": {
        "loop": "time, displacement, force", "sweep": "frequency, amplitude, stiffness, loss factor",
        "coupon": "frequency, strain amplitude, storage modulus, loss modulus",
    },
    "camel": {
        "loop": "Time, Axial Displacement, Axial Force", "sweep": "Frequency, Amplitude, DynamicStiffness, TanDelta",
    },
    "german": {
        "loop": "Zeit, Weg, Kraft", "sweep": "Frequenz, Amplitude, Dynamische Steifigkeit, Verlustfaktor",
        "coupon": "Frequenz, Scherdehnung, Speichermodul G', Verlustmodul G''",
    },
    "umlaut": {
        "loop": "Prüfzeit, Prüfweg, Prüfkraft", "sweep": "Prüffrequenz, Wegamplitude, Steifigkeit, Verlustfaktor",
    },
    "ascii umlaut": {
        "loop": "Pruefzeit, PRUEFWEG, Prufkraft", "sweep": "Prueffrequenz, Wegamplitude, Steifigkeit, Verlustfaktor",
    },
    "french": {
        "loop": "Temps, Déplacement, Effort", "sweep": "Fréquence, Amplitude, Raideur, Facteur de pertes",
        "coupon": "Fréquence, Déformation dynamique, Module de conservation, Module de perte",
    },
    "french ascii": {"loop": "TEMPS, DEPLACEMENT, FORCE", "sweep": "FREQUENCE, AMPLITUDE, RAIDEUR, FACTEUR DE PERTE"},
    "spanish": {
        "loop": "Tiempo, Desplazamiento, Fuerza",
        "sweep": "Frecuencia, Amplitud, Rigidez dinámica, Factor de pérdida",
        "coupon": "Frecuencia, Amplitud de deformación, Módulo de almacenamiento, Módulo de pérdida",
    },
    "spanish ascii": {
        "loop": "tiempo, desplazamiento, carga", "sweep": "frecuencia, amplitud, rigidez, factor de perdidas",
    },
    "chinese": {
        "loop": "时间, 位移, 力", "sweep": "频率, 振幅, 刚度, 损耗因子",
        "coupon": "频率, 剪切应变, 储能模量, 损耗模量",
    },
    "bluehill": {"loop": "Time, Extension, Load"},
    "test suite": {"loop": "Running Time, Axial Displacement, Axial Force"},
    "daq": {"loop": "Time , Crosshead , Load "},
    "wave matrix": {"loop": "Total Time, Position(Linear:Position), Load(Linear:Load)"},
    "win test": {"loop": "Elapsed Time, Disp, Load"},
    "trapezium": {"loop": "Time, Stroke, Force"},
    "test xpert": {
        "loop": "Prüfzeit, Standardweg, Standardkraft",
        "sweep": "Prüffrequenz, Wegamplitude, Dyn. Steifigkeit, Verlustfaktor tan d",
    },
    "test xpert french": {"loop": "Temps, Course standard, Force standard"},
    "mts": {"sweep": "Frequency, Dynamic Displacement p-p, K*, Tan Delta"},
    "symbols": {"sweep": "f, A, c dyn, tan δ", "coupon": "f, Strain dyn, G', G''"},
    "amplitude SS": {"sweep": "Frequenz, Amplitude SS, Dyn. Federrate, tan delta"},
    "metravib": {"sweep": "Fréquence, Amplitude crête, Raideur dynamique K*, tan(δ)"},
    "snake": {"coupon": "freq, strain_dyn, G_storage, G_loss"},
    "trios": {"coupon": "Frequency, Oscillation strain, Storage modulus, Loss modulus"},
    "trios omega": {"coupon": "Angular frequency, Oscillation strain, Storage modulus, Loss modulus"},
    "rheo compass": {"coupon": "Frequency, Shear Strain, Storage Modulus, Loss Modulus"},
    "rheo compass omega": {"coupon": "Angular Frequency, Shear Strain, G', G''"},
    "rspace": {
        "coupon": "Frequency, Complex shear strain, "
        "Shear modulus (elastic component), Shear modulus (viscous component)",
    },
    "osc": {"coupon": "Freq, Strain, G', G\""},
}  # fmt: skip
UNITS: dict[Kind, list[str]] = {
    "loop": ["s", "mm", "N"],
    "sweep": ["Hz", "mm", "N/mm", "-"],
    "coupon": ["Hz", "%", "MPa", "MPa"],
}


@dataclass(frozen=True)
class Dialect:
    """A way to write a table.

    `unit` is how a header carries its unit; None puts it into a row below. `others` are columns that are not needed, in
    ascending order: place, header, unit and cell. `double` says that amplitudes count peak-to-peak.
    """

    kind: Kind = "loop"
    delimiter: str = ","
    decimal: str = "."
    thousands: str = ""
    encoding: str = "utf-8"
    end: str = "\n"
    language: str = "english"
    unit: str | None = "{0} [{1}]"
    units: dict[str, str] = field(default_factory=dict)
    before: Sequence[str] = ()
    between: dict[int, str] = field(default_factory=dict)
    quotes: bool = False
    trailing: bool = False
    pad: int = 0
    order: Sequence[int] = ()
    extra: str = ""
    commented_header: bool = False
    units_row: str = "{0}"
    last_line_ends: bool = True
    others: Sequence[tuple[int, str, str, str]] = ()
    quoted_header: bool = False
    double: bool = False

    @property
    def headers(self) -> list[str]:
        """The headers of the kind's columns."""
        return HEADERS[self.language][self.kind].split(", ")

    def unit_of(self, index: int) -> str:
        """The unit of a column of the kind, as the table has it."""
        unit = UNITS[self.kind][index]
        return self.units.get(unit, unit)

    def place(self, index: int) -> int:
        """Where a column of the kind stands in a row."""
        place = list(self.columns).index(index)
        for other, *_ in self.others:
            place += other <= place
        return place

    def cells(self, own: Sequence[str], which: int) -> list[str]:
        """A row with the columns that are not needed: their headers (1), units (2) or cells (3)."""
        cells = list(own)
        for other in self.others:
            cells.insert(other[0], str(other[which]))
        return cells + ["", self.extra, "", "ok"][which : which + 1] * bool(self.extra)

    def row(self, row: Sequence[Decimal]) -> list[str]:
        """The cells of a row of numbers."""
        return self.cells([self.number(row[i]) for i in self.columns], 3)

    @property
    def columns(self) -> Sequence[int]:
        return self.order or range(len(UNITS[self.kind]))

    def number(self, value: Decimal) -> str:
        text = f"{value:,}" if self.thousands else f"{value}"
        signs = {",": self.thousands, ".": self.decimal}
        return "".join(signs.get(sign, sign) for sign in text).rjust(self.pad)

    def line(self, cells: Sequence[str], *, is_header: bool = False) -> str:
        if self.quotes or (is_header and self.quoted_header):
            cells = [f'"{cell}"' for cell in cells]
        return self.delimiter.join(cells) + self.delimiter * self.trailing

    def text(self) -> str:
        """The table as text."""
        units = [self.unit_of(i) for i in self.columns]
        names = [self.headers[i] for i in self.columns]
        others = [
            (place, self.unit.format(header, unit) if self.unit and unit else header, unit, cell)
            for place, header, unit, cell in self.others
        ]
        named = replace(self, others=others)
        if self.unit:
            names = [self.unit.format(name, unit) for name, unit in zip(names, units, strict=True)]
        lines = [line.format(self.delimiter) for line in self.before]
        lines.append("# " * self.commented_header + self.line(named.cells(names, 1), is_header=True))
        if self.unit is None:
            row = [self.units_row.format(unit) if unit else "" for unit in named.cells(units, 2)]
            lines.append(self.line(row, is_header=True))
        for number, row in enumerate(NUMBERS[self.kind]):
            lines += [self.between[number]] if number in self.between else []
            lines.append(self.line(self.row(row)))
        return self.end.join(lines) + self.end * self.last_line_ends

    def bytes(self) -> bytes:
        """The table as a file."""
        return self.encoded(self.text())

    def encoded(self, text: str) -> bytes:
        """A text as a file."""
        marks = {"utf-16-le with mark": ("utf-16-le", "\ufeff"), "utf-16-be with mark": ("utf-16-be", "\ufeff")}
        encoding, mark = marks.get(self.encoding, (self.encoding, ""))
        return (mark + text).encode(encoding)


DIALECTS = {
    "plain": Dialect(),
    "plain sweep": Dialect("sweep"),
    "semicolons": Dialect(delimiter=";"),
    "tabs": Dialect(delimiter="\t"),
    "pipes": Dialect(delimiter="|"),
    "comma and blank": Dialect(delimiter=", "),
    "fixed width": Dialect(delimiter="  ", pad=12, unit="{0}[{1}]"),
    "single blanks, units below": Dialect(delimiter=" ", unit=None),
    "wide header": Dialect("sweep", delimiter="   ", unit="{0} ({1})"),
    "CRLF": Dialect(end="\r\n"),
    "lone CR": Dialect(end="\r"),
    "no last line end": Dialect(last_line_ends=False),
    "BOM": Dialect(encoding="utf-8-sig"),
    "BOM, CRLF, semicolons": Dialect("sweep", encoding="utf-8-sig", end="\r\n", delimiter=";"),
    "UTF-16 LE": Dialect(encoding="utf-16-le with mark", delimiter="\t", end="\r\n"),
    "UTF-16 BE": Dialect(encoding="utf-16-be with mark", language="german", decimal=",", delimiter=";"),
    "UTF-16 LE without mark": Dialect(encoding="utf-16-le"),
    "UTF-16 BE without mark": Dialect("sweep", encoding="utf-16-be", delimiter="\t"),
    "German": Dialect(delimiter=";", decimal=",", language="german"),
    "German sweep": Dialect("sweep", delimiter=";", decimal=",", language="german"),
    "German, tabs, Latin-1": Dialect(delimiter="\t", decimal=",", language="umlaut", encoding="latin-1"),
    "German, thousands": Dialect(delimiter=";", decimal=",", thousands=".", language="german", encoding="cp1252"),
    "German, thousands, sweep": Dialect("sweep", delimiter=";", decimal=",", thousands=".", language="umlaut"),
    "umlauts written out": Dialect(delimiter=";", decimal=",", language="ascii umlaut"),
    "umlauts, sweep, cp1252": Dialect("sweep", delimiter=";", decimal=",", language="umlaut", encoding="cp1252"),
    "unit after in": Dialect(delimiter=";", decimal=",", language="german", unit="{0} in {1}"),
    "unit after slash": Dialect(delimiter=";", decimal=",", language="german", unit="{0} / {1}"),
    "quoted decimal commas": Dialect(decimal=",", quotes=True, language="german"),
    "French, NBSP": Dialect(delimiter=";", decimal=",", thousands="\u00a0", language="french", encoding="cp1252"),
    "French, thin blanks": Dialect(delimiter=";", decimal=",", thousands="\u202f", language="french"),
    "French ASCII": Dialect("sweep", delimiter=";", decimal=",", language="french ascii"),
    "French, blanks as thousands": Dialect("sweep", delimiter="\t", decimal=",", thousands=" ", language="french"),
    "Spanish": Dialect(delimiter=";", decimal=",", language="spanish"),
    "Spanish sweep, Latin-1": Dialect("sweep", delimiter=";", decimal=",", language="spanish", encoding="latin-1"),
    "Spanish ASCII, points": Dialect("sweep", language="spanish ascii", unit="{0}_{1}"),
    "Swiss": Dialect(delimiter=";", thousands="'", language="german"),
    "Swiss, typographic": Dialect("sweep", delimiter=";", thousands="\u2019", language="german"),
    "English thousands, tabs": Dialect(delimiter="\t", thousands=","),
    "English thousands, quoted": Dialect("sweep", thousands=",", quotes=True),
    "Chinese": Dialect(encoding="gb18030", language="chinese"),
    "Chinese 2": Dialect("sweep", encoding="gb18030", language="chinese", delimiter="\t", unit="{0}\uff08{1}\uff09"),
    "Chinese preamble": Dialect(encoding="gb18030", before=["试验名称,橡胶衬套", "操作员,王"]),
    "Chinese in UTF-8": Dialect(encoding="utf-8-sig", language="chinese", unit="{0}({1})"),
    "units row": Dialect(unit=None),
    "units row in brackets": Dialect("sweep", delimiter=";", unit=None, units_row="[{0}]"),
    "units row with signs": Dialect("sweep", unit=None, delimiter="\t", units={"-": ""}),
    "unit spellings": Dialect(language="camel", unit="{0}({1})", units={"s": "sec", "mm": "Millimeter"}),
    "underscores": Dialect(unit="{0}_{1}"),
    "CamelCase sweep": Dialect("sweep", language="camel", unit="{0} ({1})"),
    "comments lead": Dialect(before=["# rig 3", "# 2026-01-01", ""]),
    "percent comments": Dialect(before=["% rig 3", "%"], delimiter="\t"),
    "slash comments": Dialect(before=["// rig 3"], delimiter=";"),
    "semicolon comments": Dialect(before=["; rig 3; lab 2", ";"]),
    "machine preamble": Dialect(before=MACHINE, delimiter=";", decimal=",", language="german"),
    "machine preamble, tabs": Dialect(before=MACHINE, delimiter="\t", unit=None, end="\r\n", encoding="cp1252"),
    "machine preamble, commas": Dialect("sweep", before=[*MACHINE, "Results"], encoding="latin-1"),
    "Excel's sep line": Dialect(before=["sep=;"], delimiter=";", decimal=",", language="german", end="\r\n"),
    "commented header": Dialect(commented_header=True),
    "comments between rows": Dialect(between={7: "# paused", 20: "", 31: "% resumed"}),
    "empty rows between": Dialect(delimiter=";", decimal=",", language="german", between={5: ";;", 9: ""}),
    "trailing delimiters": Dialect(delimiter=";", trailing=True),
    "trailing commas, sweep": Dialect("sweep", trailing=True, end="\r\n"),
    "all quoted": Dialect(quotes=True),
    "padded cells": Dialect(delimiter=";", pad=14),
    "other order": Dialect(order=[2, 0, 1], delimiter=";", decimal=",", language="spanish"),
    "other order, sweep": Dialect("sweep", order=[3, 2, 1, 0]),
    "MTS data header": Dialect(
        delimiter=";", unit=None, units={"s": "Sec"}, language="test suite", others=[(3, "Temp", "", "23")],
        before=["Data Header: time axial disp 12.3 force sec 3/4/2024 10:11:12 AM", ""],
    ),
    "remarks": Dialect(extra="remark"),
    "remarks, decimal commas": Dialect("sweep", extra="Bemerkung", delimiter=";", decimal=",", language="german"),
}  # fmt: skip
