"""Readers of what bushfit exports, none of them bushfit's: pyNastran, and parsers written from the vendors' pages.

And the kept computation of the paper's bushing, level by level, as decks hold it.
"""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bushfit.geometry import Direction

#: Of an order that no file stands behind.
HASH = "0123456789abcdef" * 4
#: By degree of freedom from 1 and by level from 1: frequency, and complex stiffness, in the units of the deck.
Curves = dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]


def by_pynastran(file: Path) -> Curves:
    """PBUSH, PBUSHT and TABLED1 of a deck as pyNastran reads them: K (1 + i GE)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyNastran's own
        from pyNastran.bdf.bdf import read_bdf

        deck = read_bdf(str(file), punch=True, xref=False, debug=None)
    assert not deck.reject_cards
    assert not deck.reject_lines
    found: Curves = {}
    for pid, card in deck.properties.items():
        table = deck.pbusht[pid]
        for place, (k, ge) in enumerate(zip(table.k_tables, table.ge_tables, strict=True)):
            assert (k is None) == (ge is None) == (card.Ki[place] is None)
            if k is not None:
                stiffness, loss = deck.tables_d[k], deck.tables_d[ge]
                np.testing.assert_array_equal(stiffness.x, loss.x)
                assert (card.Ki[place], card.GEi[place]) == (stiffness.y[0], loss.y[0])
                found[place + 1, pid] = (stiffness.x, stiffness.y * (1.0 + 1j * loss.y))
    return found


def bulk_cards(text: str) -> list[list[str]]:
    """The cards of bulk data as fields, the name first.

    Fields are 8 columns, or 16 between the first and the last of a line whose name ends on a star; a line without a
    name goes on with the card above (Altair OptiStruct 2021 reference, "Bulk Data Input File": fixed format, large
    field).
    """
    cards: list[list[str]] = []
    for line in text.splitlines():
        if not line.startswith("$"):
            name = line[:8].strip()
            width = 16 if name.endswith("*") else 8
            fields = [line[at : at + width].strip() for at in range(8, 72, width)]
            if name.strip("*"):
                cards.append([name.strip("*"), *fields])
            else:
                cards[-1] += fields
    return cards


def by_optistruct(text: str) -> Curves:
    """PBUSHT with KMAG and ANGLE: "K equals KMAG*cos(angle) and GE equals tan(ANGLE)", the angle in deg.

    Source: Altair OptiStruct 2021 reference, PBUSH (format, example 3: ANGLE 15.0) and PBUSHT (format, comments).
    """
    cards, found = bulk_cards(text), Curves()
    tables = {}
    for name, number, *fields in cards:
        if name == "TABLED1":
            assert fields[:2] == ["LINEAR", "LINEAR"]
            assert [field for field in fields if field][-1] == "ENDT"
            values = [float(field) for field in fields[7:] if field not in ("", "ENDT")]
            tables[number] = np.array(values).reshape(-1, 2).T
    nominal = {card[1]: card[2:] for card in cards if card[0] == "PBUSH"}
    for name, number, *fields in cards:
        if name == "PBUSHT":
            assert (fields[0], fields[7], fields[8]) == ("KMAG", "", "ANGLE")
            size, angle = fields[1:7], fields[9:15]
            for dof, (k, a) in enumerate(zip(size, angle, strict=True), start=1):
                assert (k == "") == (a == "")
                if k:
                    (f, magnitude), (_, degrees) = tables[k], tables[a]
                    storage = magnitude * np.cos(np.radians(degrees))
                    found[dof, int(number)] = (f, storage * (1.0 + 1j * np.tan(np.radians(degrees))))
                    assert float(nominal[number][dof]) == magnitude[0]
    return found


def abaqus_options(text: str) -> list[tuple[str, dict[str, str], list[list[float]]]]:
    """The keyword lines of an input file, their parameters, and the numbers of their data lines.

    Source: Abaqus Analysis User's Guide, "Input syntax rules": ** begins a comment, * a keyword line, commas part
    parameters and data items, a line has at most 256 characters and a label at most 80.
    """
    found: list[tuple[str, dict[str, str], list[list[float]]]] = []
    for line in text.splitlines():
        assert len(line) <= 256
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            keyword, *parameters = (part.strip() for part in line[1:].split(","))
            pairs = dict(part.partition("=")[::2] for part in parameters)
            assert all(len(value) <= 80 for value in pairs.values())
            found.append((keyword, pairs, []))
        else:
            found[-1][2].append([float(part) for part in line.split(",")])
    return found


def by_abaqus(text: str) -> Curves:
    """Connector behaviors: D + i omega C, of 21 constants and a frequency in three lines of eight, eight and six.

    Source: Abaqus Keywords Reference Guide, *CONNECTOR ELASTICITY, *CONNECTOR DAMPING, "linear coupled ... with
    frequency dependence": D11, D12, D22, D13, D23, D33, D14, D24 / D34, D44, D15, D25, D35, D45, D55, D16 / D26, D36,
    D46, D56, D66, frequency in cycles per time.
    """
    order = [(i, j) for j in range(1, 7) for i in range(1, j + 1)]
    found: Curves = {}
    rank, matrices = 0, dict[str, Any]()
    for keyword, parameters, lines in abaqus_options(text):
        if keyword == "CONNECTOR BEHAVIOR":
            rank += 1
            assert parameters == {"NAME": f"BUSHING_{rank}"}
        elif keyword.startswith("CONNECTOR"):
            assert parameters == {"FREQUENCY DEPENDENCE": "ON"}
            assert [len(line) for line in lines] == [8, 8, 6] * (len(lines) // 3)
            rows = np.array([[*lines[at], *lines[at + 1], *lines[at + 2]] for at in range(0, len(lines), 3)])
            matrices[keyword] = rows
            for column, (i, j) in enumerate(order):
                assert i == j or not rows[:, column].any()
            if keyword == "CONNECTOR DAMPING":
                stiff = matrices["CONNECTOR ELASTICITY"]
                f = rows[:, -1]
                np.testing.assert_array_equal(stiff[:, -1], f)
                for column, (i, j) in enumerate(order):
                    if i == j and stiff[:, column].any():
                        found[i, rank] = (f, stiff[:, column] + 2j * np.pi * f * rows[:, column])
    return found


def teimorbit(text: str) -> dict[str, tuple[dict[str, str], list[str], np.ndarray]]:
    """The blocks of a TeimOrbit file: attributes, names of the table's columns, and the table.

    Source: Altair MotionView help, "TeimOrbit Format" (blocks in brackets, attributes with =, tables below names in
    braces); MSC Adams Tire help (lines that begin with $ are comments).
    """
    found: dict[str, tuple[dict[str, str], list[str], list[list[float]]]] = {}
    attributes: dict[str, str] = {}
    names: list[str] = []
    rows: list[list[float]] = []
    for line in text.splitlines():
        if line.startswith(("$", "!")):
            continue
        if block := re.fullmatch(r"\[(\w+)\]", line):
            attributes, names, rows = {}, [], []
            found[block[1]] = (attributes, names, rows)
        elif line.startswith("{"):
            names += line.strip("{}").split()
        elif "=" in line:
            key, _, value = line.partition("=")
            attributes[key.strip()] = value.strip()
        else:
            rows.append([float(part) for part in line.split()])
    return {block: (pairs, columns, np.array(table)) for block, (pairs, columns, table) in found.items()}


def residual_slices(known: pd.DataFrame, direction: Direction, level: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Amplitude, frequencies and complex stiffness of the kept computation at a level from 1, or else the last."""
    rows = known[known["direction"] == direction]
    amplitudes = np.sort(rows["amplitude"].unique())
    amplitude = amplitudes[min(level, amplitudes.size) - 1]
    rows = rows[rows["amplitude"] == amplitude].sort_values("frequency")
    storage = rows["stiffness"] / np.hypot(1.0, rows["loss"])
    return float(amplitude), rows["frequency"].to_numpy(), (storage * (1.0 + 1j * rows["loss"])).to_numpy()
