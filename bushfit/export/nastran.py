"""Nastran and OptiStruct: PBUSH and PBUSHT, one property per amplitude, with tables over frequency.

In a frequency response the element has K (1 + i GE) in each degree of freedom; other solutions use the nominal values
of PBUSH, here those of the lowest frequency. OptiStruct also accepts |K| and the loss angle: K = KMAG cos(ANGLE) and
GE = tan(ANGLE), the angle in deg.

Source: Autodesk Nastran 2025 reference, PBUSHT; Altair OptiStruct 2021 reference, PBUSH (example 3) and PBUSHT.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.export.contract import MM_T_S_N, ExportedFiles, ExportRequest
from bushfit.export.deck import (
    StiffnessForm,
    amplitude_levels,
    by_dof,
    comment_lines,
    describe_amplitudes,
    format_real,
    heading,
    table_omissions,
)

#: Difference between the table numbers of two properties. The last two digits are the degree of freedom n for K, and
#: 10 + n for the loss.
_TABLES = 100


#: Names of the two tables, conversion of the complex stiffness to the two tables, and name of the file, by dialect.
_DIALECTS = {
    "nastran": (
        ("K", "GE"),
        StiffnessForm(lambda _, k: (k.real, k.imag / k.real), lambda _, a, b: a * (1.0 + 1j * b)),
        "bushing.bdf",
    ),
    "optistruct": (
        ("KMAG", "ANGLE"),
        StiffnessForm(lambda _, k: (np.abs(k), np.angle(k, deg=True)), lambda _, a, b: a * np.exp(1j * np.radians(b))),
        "bushing.fem",
    ),
}


def export(request: ExportRequest) -> ExportedFiles:
    """Write one bushing property per amplitude as bulk data of Nastran or OptiStruct.

    PBUSH has the values at the lowest frequency. For several frequencies PBUSHT refers to the tables: a card TABLED1
    for each degree of freedom and keyword ("K" and "GE", in OptiStruct "KMAG" and "ANGLE").

    Args:
        request: model, predictions and settings.

    Returns:
        File with the deck, and sentences on properties that the format cannot represent.
    """
    (names, form, file), units = _DIALECTS[request.dialect], request.units or MM_T_S_N
    omissions = tuple(table_omissions(request, form))
    usage = (
        "the tables act in frequency response; PBUSH alone, at the lowest frequency, acts elsewhere; PARAM,G is added "
        "to the loss"
    )
    lines = comment_lines("$", [*heading(request, units, omissions), usage])
    for rank, level in amplitude_levels(request):
        lines += comment_lines("$", [f"property {rank}: {describe_amplitudes(level)}"])
        columns = {dof: form.in_units(table, units) for dof, table in by_dof(level)}
        numbers = {(dof, part): str(_TABLES * rank + 10 * part + dof) for dof in columns for part in (0, 1)}
        nominal = {(dof, part): format_real(columns[dof][1 + part][0]) for dof, part in numbers}

        cards = {"PBUSH*": nominal, "PBUSHT": numbers} if level[0].frequency.size > 1 else {"PBUSH*": nominal}
        for card, entries in cards.items():
            rows = [[name, *(entries.get((dof, part), "") for dof in range(1, 7))] for part, name in enumerate(names)]
            lines += _card(card, [str(rank), *rows[0], "", *rows[1]])
        if "PBUSHT" in cards:
            for (dof, part), table_number in numbers.items():
                points = zip(columns[dof][0], columns[dof][1 + part], strict=True)
                pairs = [text for f, value in points for text in (format_real(f, 10), format_real(value))]
                lines += _card("TABLED1*", [table_number, "LINEAR", "LINEAR", *5 * [""], *pairs, "ENDT"])
    return ExportedFiles({file: "".join(f"{line}\n" for line in lines).encode("ascii")}, omissions)


def _card(name: str, fields: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a bulk data card: eight small fields per line, or four large ones if its name ends in "*"."""
    count, shape, begin = (4, ">16", "*") if name.endswith("*") else (8, "<8", "")
    padded = [*fields, *[""] * (-len(fields) % 8)]
    for start in range(0, len(padded), count):
        yield (f"{name:<8}" + "".join(f"{text:{shape}}" for text in padded[start : start + count])).rstrip()
        name = begin
