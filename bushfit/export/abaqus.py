"""Abaqus: a connector with tables of stiffness and damping over frequency, and the compound as a material.

Connector: with FREQUENCY DEPENDENCE=ON the 21 constants of the symmetric 6 x 6 matrix take three lines per frequency,
the upper triangle column by column. Forces are D u + C du/dt, so C is the loss stiffness over 2 pi f.

Material: neo-Hooke with C10 = G/2 for the long-term modulus G (of the elastic branch) and D1 = 0 for an incompressible
rubber. For the frequency domain, the table has omega Re(g*) = G''/G and omega Im(g*) = 1 - G'/G, two columns of bulk,
which are zero, and the frequency. For the time domain, each line has g_i, k_i = 0 and tau_i of a Prony series.

Source: Abaqus Keywords Reference Guide, *CONNECTOR ELASTICITY, *CONNECTOR DAMPING, *HYPERELASTIC and *VISCOELASTIC;
Abaqus Analysis User's Guide, "Frequency domain viscoelasticity" and "Time domain viscoelasticity".
"""

from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import Level as EffectLevel
from bushfit.export.contract import MM_T_S_N, ExportedFiles, ExportRequest, UnitSystem
from bushfit.export.deck import (
    StiffnessForm,
    amplitude_levels,
    by_dof,
    comment_lines,
    describe_amplitudes,
    exported_directions,
    format_real,
    heading,
    stiffness_tables,
    table_omissions,
)
from bushfit.export.prony import COMPOUND, LONG_TERM, PronySeries, prony_omissions, prony_series
from bushfit.units import number

#: Number of constants of a symmetric 6 x 6 matrix, and of values per data line.
_CONSTANTS, _A_LINE = 21, 8

_FORM = StiffnessForm(lambda f, k: (k.real, k.imag / (2.0 * np.pi * f)), lambda f, a, b: a + 2j * np.pi * f * b)


def export(request: ExportRequest) -> ExportedFiles:
    """Write an Abaqus connector behavior for each amplitude, and a material at the strains of the first direction.

    Args:
        request: model, predictions and settings.

    Returns:
        File bushing.inp, and sentences on properties that the format cannot represent.
    """
    units = request.units or MM_T_S_N
    omissions = tuple(table_omissions(request, _FORM))
    series = prony_series(request) if request.time_domain else []
    if has_material := LONG_TERM in request.result.model.values:
        sentence = "compound: the material has one strain amplitude everywhere, which its table states"
    else:
        sentence = "compound: no elastic branch, so no long-term modulus, and no material"
    usage = "behaviors are for CONN3D2 of type BUSHING; they act in *STEADY STATE DYNAMICS, DIRECT"
    omissions += (Caveat("format_omission", sentence), *(prony_omissions(series) if series else ()))
    lines = comment_lines("**", [*heading(request, units, omissions), usage])
    for rank, level in amplitude_levels(request):
        lines += comment_lines("**", [f"BUSHING_{rank}: {describe_amplitudes(level)}"])
        lines.append(f"*CONNECTOR BEHAVIOR, NAME=BUSHING_{rank}")
        frequency = level[0].frequency * units.frequency.factor
        diagonals = np.zeros((2, 6, frequency.size))
        for dof, table in by_dof(level):
            diagonals[:, dof - 1] = _FORM.in_units(table, units)[1:]
        for keyword, diagonal in zip(("ELASTICITY", "DAMPING"), diagonals, strict=True):
            lines.append(f"*CONNECTOR {keyword}, FREQUENCY DEPENDENCE=ON")
            for f, values in zip(frequency, diagonal.T, strict=True):
                triangle = np.diag(values).T[np.tril_indices(6)]  # upper triangle of the matrix, column by column
                texts = [*(format_real(value) for value in triangle), format_real(f, 10)]
                starts = range(0, _CONSTANTS + 1, _A_LINE)
                lines += [", ".join(texts[start : start + _A_LINE]) for start in starts]
    lines += _materials(request, units, series) if has_material else ()
    return ExportedFiles({"bushing.inp": "".join(f"{line}\n" for line in lines).encode("ascii")}, omissions)


def _materials(request: ExportRequest, units: UnitSystem, series: Sequence[PronySeries]) -> Iterator[str]:
    """Yield the lines of a material for the strain at each amplitude of the first direction.

    Args:
        request: model, predictions and settings.
        units: unit system of the deck.
        series: Prony series at each amplitude; empty to write materials in the frequency domain.
    """
    model, first = request.result.model.without(EffectLevel.INSTRUMENT), exported_directions(request)[0]
    long_term = series[0].long_term if series else model.values[LONG_TERM]
    for rank, table in enumerate(stiffness_tables(first), start=1):
        strain = 2.0 * table.amplitude * model.unit_strain(first.direction)  # engineering shear strain
        about = f"shear strain amplitude {number(100.0 * strain, 6)} %, from {describe_amplitudes((table,))}"
        yield from comment_lines("**", [f"COMPOUND_{rank}: {about}"])
        yield f"*MATERIAL, NAME=COMPOUND_{rank}"
        yield "*HYPERELASTIC, NEO HOOKE, MODULI=LONG TERM"
        yield f"{format_real(0.5 * long_term * units.stress.factor)}, 0."
        if series:
            terms = series[rank - 1]
            yield "*VISCOELASTIC, TIME=PRONY"
            for relative, time in zip(terms.relative_moduli, terms.arms.time * units.time.factor, strict=True):
                yield f"{format_real(relative, 7)}, 0., {format_real(time, 7)}"
            continue
        ratio = model.stiffness(COMPOUND, table.frequency, strain, conditions=request.conditions) / long_term
        yield "*VISCOELASTIC, FREQUENCY=TABULAR"
        for f, loss, gain in zip(table.frequency * units.frequency.factor, ratio.imag, 1.0 - ratio.real, strict=True):
            yield f"{format_real(loss)}, {format_real(gain)}, 0., 0., {format_real(f, 10)}"
