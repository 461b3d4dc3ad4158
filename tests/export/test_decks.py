"""Decks read back by programs and parsers that are not bushfit's, against a computation that is not bushfit's."""

import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from readers import HASH, Curves, abaqus_options, by_abaqus, by_optistruct, by_pynastran, residual_slices, teimorbit

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.errors import ModelError
from bushfit.export import abaqus, adams, nastran, prony
from bushfit.export.contract import MM_T_S_N, ExportedFiles, ExportRequest, UnitSystem
from bushfit.export.deck import DOFS
from bushfit.geometry import Direction, Specimen
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.simulation.rig import wave

#: Agreement of the model itself with the kept computation, as tests/model/test_model.py holds it.
MODEL = 2e-4
#: What the five digits of a deck leave of a value, and ten of what a table goes over.
DIGITS, ALONG = 5e-5, 2e-9
SYSTEMS = ["N, s, t, mm", "m kg s N", "mm kg ms kN", "in lbf*s^2/in s lbf"]
ENDS = ("FX", "FY", "FZ", "TX", "TY", "TZ")
WRITERS: list[Callable[[ExportRequest], ExportedFiles]] = [nastran.export, abaqus.export, adams.export]


def read(name: str, export_request: ExportRequest, folder: Path) -> tuple[ExportedFiles, Curves]:
    """The export of a format, and what its reader finds in it."""
    if name == "abaqus":
        exported = abaqus.export(export_request)
        return exported, by_abaqus(exported.files["bushing.inp"].decode("ascii"))
    exported = nastran.export(replace(export_request, dialect=name))
    ((file, content),) = exported.files.items()
    (folder / file).write_bytes(content)
    found = by_pynastran(folder / file) if name == "nastran" else by_optistruct(content.decode("ascii"))
    return exported, found


@pytest.mark.parametrize("units", SYSTEMS)
@pytest.mark.parametrize("name", ["nastran", "optistruct", "abaqus"])
def test_every_value_of_the_grid_is_read_back(name, units, export_request, known, tmp_path):
    """In whatever units, turned back into SI by factors that are typed here."""
    newton, metre, second = {
        "N, s, t, mm": (1.0, 1e3, 1.0),
        "m kg s N": (1.0, 1.0, 1.0),
        "mm kg ms kN": (1e-3, 1e3, 1e3),
        "in lbf*s^2/in s lbf": (1.0 / 4.4482216152605, 1.0 / 0.0254, 1.0),
    }[units]
    _, found = read(name, replace(export_request, units=UnitSystem.parse(units)), tmp_path)
    ranks = range(1, 6)  # five amplitudes in axial direction, fewer in the others
    assert set(found) == {(dof, rank) for dofs in DOFS.values() for dof in dofs for rank in ranks}
    worst, apart = 0.0, 0.0
    for direction, dofs in DOFS.items():
        scale = newton * metre if direction is Direction.TORSION else newton / metre
        for dof in dofs:
            for rank in ranks:
                amplitude, frequency, stiffness = residual_slices(known, direction, rank)
                f, k = found[dof, rank]
                np.testing.assert_allclose(f * second, frequency, rtol=ALONG)
                worst = max(worst, np.abs(k / scale / stiffness - 1.0).max())
                exact = export_request.result.model.stiffness(direction, frequency, amplitude)
                apart = max(apart, np.abs(k / scale / exact - 1.0).max())
    assert worst < MODEL
    assert apart < DIGITS


def test_the_compound_of_abaqus_is_the_model_at_that_strain(export_request, paper_model):
    """*HYPERELASTIC: C10 = G/2. *VISCOELASTIC: omega Re(g*) = G''/G, omega Im(g*) = 1 - G'/G, bulk, frequency.

    Source: Abaqus Analysis User's Guide, "Frequency domain viscoelasticity": storage modulus
    G (1 - omega Im g*), loss modulus G omega Re g*.
    """
    text = abaqus.export(export_request).files["bushing.inp"].decode("ascii")
    options = abaqus_options(text)
    starts = [place for place, (keyword, _, _) in enumerate(options) if keyword == "MATERIAL"]
    amplitudes = np.unique(export_request.predictions[0].amplitude)
    assert len(starts) == amplitudes.size == 5
    for start, amplitude in zip(starts, amplitudes, strict=True):
        (_, hyper, ((c10, d1),)), (_, visco, rows) = options[start + 1 : start + 3]
        assert hyper == {"NEO HOOKE": "", "MODULI": "LONG TERM"}
        assert visco == {"FREQUENCY": "TABULAR"}
        assert d1 == 0.0
        loss, gain, bulk_loss, bulk_gain, frequency = np.array(rows).T
        assert not bulk_loss.any()
        assert not bulk_gain.any()
        modulus = 2.0 * c10 * (1.0 - gain + 1j * loss) * 1e6  # N/mm^2
        # of the axial stiffness, Eq. 10: K = 2 pi L G/ln(b/a)
        axial = paper_model.stiffness("axial", frequency, amplitude)
        np.testing.assert_allclose(modulus, axial * np.log(1.8) / (2.0 * np.pi * 0.034), rtol=DIGITS)


@pytest.mark.parametrize("units", ["N, s, t, mm", "mm kg ms kN"])
def test_the_prony_series_of_abaqus_and_of_the_table_is_the_model_within_the_stated_error(
    export_request, paper_model, units
):
    """G* = G_0 (1 - sum g_i) + G_0 sum g_i i omega tau_i/(1 + i omega tau_i), read back at its strain amplitude.

    Source: Abaqus Keywords Reference Guide, *VISCOELASTIC, TIME=PRONY: g_i, k_i, tau_i, a line per term.
    """
    system = UnitSystem.parse(units)
    request = replace(export_request, units=system, time_domain=True)
    options = abaqus_options(abaqus.export(request).files["bushing.inp"].decode("ascii"))
    table = pd.read_csv(io.BytesIO(prony.export(request).files["prony.csv"]))
    starts = [place for place, (keyword, _, _) in enumerate(options) if keyword == "MATERIAL"]
    frequency = np.geomspace(5.0, 155.0, 500)
    turn = 2j * np.pi * frequency
    by_amplitude = table.groupby("axial amplitude [mm]")
    assert len(starts) == by_amplitude.ngroups == 5
    for start, (amplitude, rows) in zip(starts, by_amplitude, strict=True):
        (_, hyper, ((c10, d1),)), (_, visco, terms) = options[start + 1 : start + 3]
        assert (hyper, visco, d1) == ({"NEO HOOKE": "", "MODULI": "LONG TERM"}, {"TIME": "PRONY"}, 0.0)
        relative, bulk, time = np.array(terms).T
        assert not bulk.any()
        assert (relative > 0.0).all()
        assert relative.sum() < 1.0
        seconds = time / system.time.factor
        assert (seconds >= 0.99e-1 / (2.0 * np.pi * 155.0)).all()
        assert (seconds <= 10.1 / (2.0 * np.pi * 5.0)).all()
        rest = 2.0 * c10 / system.stress.factor
        assert rest == pytest.approx(1.09e6, rel=DIGITS)
        instantaneous = rest / (1.0 - relative.sum())
        spread = turn[:, None] * seconds
        written = rest + instantaneous * (relative * spread / (1.0 + spread)).sum(axis=1)
        axial = paper_model.stiffness("axial", frequency, amplitude / 1e3)  # Eq. 10: K = 2 pi L G/ln(b/a)
        error = np.abs(written / (axial * np.log(1.8) / (2.0 * np.pi * 0.034)) - 1.0).max()
        stated = rows["largest error of the modulus [%]"].iloc[0] / 100.0
        assert error == pytest.approx(stated, rel=0.03)
        assert stated < 0.025
        np.testing.assert_allclose(rows["g_i [-]"], relative, rtol=DIGITS)
        np.testing.assert_allclose(rows["relaxation time [s]"], seconds, rtol=DIGITS)
        assert rows.filter(like="instantaneous").iloc[0, 0] == pytest.approx(instantaneous * system.stress.factor)
        strain = 2.0 * amplitude / 1e3 * paper_model.unit_strain(Direction.AXIAL)
        assert rows["shear strain amplitude [%]"].iloc[0] == pytest.approx(100.0 * strain, rel=1e-6)


@pytest.mark.parametrize("name", ["nastran", "optistruct", "abaqus"])
def test_stated_constants_are_the_rotations_without_a_law(name, export_request, tmp_path):
    stated = replace(export_request, cardanic=60.0 + 6.0j)
    exported, found = read(name, stated, tmp_path)
    assert {dof for dof, _ in found} == {1, 2, 3, 4, 5, 6}
    for dof in (4, 5):
        for rank in range(1, 6):
            np.testing.assert_allclose(found[dof, rank][1], 1e3 * (60.0 + 6.0j), rtol=DIGITS)
    omissions = " ".join(map(str, exported.omissions))
    assert "rotations about x and y: the stated constant, 60 N m/rad, loss factor 0.1" in omissions
    assert "no stiffness in" not in omissions


def test_adams_holds_curve_and_damping(export_request, known):
    """Static curve, damper or loss angle in the middle of the grid; mm, newton, degrees, second."""
    exported = adams.export(export_request)
    factors = {"x": (1e3, 1.0), "ax": (np.degrees(1.0), 1e3)}
    for kind in ("car", "ride"):
        blocks = teimorbit(exported.files[f"bushing_{kind}.bus"].decode("ascii"))
        units = {"LENGTH": "mm", "ANGLE": "degrees", "FORCE": "newton", "MASS": "kg", "TIME": "second"}
        assert blocks["UNITS"][0] == {name: f"'{unit}'" for name, unit in units.items()}
        assert list(blocks) == ["MDI_HEADER", "UNITS", "DAMPING", *(f"{end}_CURVE" for end in ENDS)]
        for direction, ends in (("axial", ["FZ"]), ("radial", ["FX", "FY"]), ("torsion", ["TZ"])):
            own = known[known["direction"] == direction]
            length, force = factors["ax" if direction == "torsion" else "x"]
            amplitudes = np.sort(own["amplitude"].unique())
            for end in ends:
                _, names, curve = blocks[f"{end}_CURVE"]
                assert names == [end[1].lower() if end[0] == "F" else f"a{end[1].lower()}", end.lower()]
                moved, resisting = curve.T
                assert (np.diff(moved) > 0.0).all()
                np.testing.assert_allclose(curve, -curve[::-1], atol=1e-9)
                assert moved[-1] == pytest.approx(amplitudes[-1] * length, rel=ALONG)
                at_end = resting(export_request.result.model, Direction(direction), amplitudes[-1])
                np.testing.assert_allclose(resisting[[0, -1]], np.array([-1.0, 1.0]) * at_end * force, rtol=MODEL)
                _, frequency, stiffness = residual_slices(known, Direction(direction), (amplitudes.size + 1) // 2)
                f, k = frequency[7], stiffness[7]  # of 16 from 5 Hz in steps of 10
                wanted = k.imag / (2.0 * np.pi * f) * force / length if kind == "car" else np.degrees(np.angle(k))
                assert float(blocks["DAMPING"][0][f"{end}_DAMPING"]) == pytest.approx(wanted, rel=5 * MODEL)
        for end in ("TX", "TY"):
            assert not blocks[f"{end}_CURVE"][2][:, 1].any()
            assert float(blocks["DAMPING"][0][f"{end}_DAMPING"]) == 0.0


@pytest.mark.parametrize("kind", ["car", "ride"])
def test_adams_says_how_far_its_element_is_off(export_request, known, kind):
    """The first harmonic of the curve as it is in the file, beside a damper or at a loss angle."""
    exported = adams.export(export_request)
    text = exported.files[f"bushing_{kind}.bus"].decode("ascii")
    blocks = teimorbit(text)
    moved, force = blocks["FZ_CURVE"][2].T
    damping = float(blocks["DAMPING"][0]["FZ_DAMPING"])
    wave = np.cos(2.0 * np.pi * np.arange(64) / 64)
    ratio, apart = [], []
    for rank in range(1, 6):
        amplitude, frequency, stiffness = residual_slices(known, Direction.AXIAL, rank)
        amplitude *= 1e3
        storage = 2.0 * np.mean(np.interp(amplitude * wave, moved, force) * wave) / amplitude
        turn = 2j * np.pi * frequency * damping if kind == "car" else 1j * storage * np.tan(np.radians(damping))
        written = storage + turn
        ratio.append(np.abs(1e3 * written / stiffness) - 1.0)
        apart.append(np.abs(written.imag / written.real - stiffness.imag / stiffness.real))
    line = next(line for line in map(str, exported.omissions) if line.startswith(f"axial, {kind}: "))
    low, high, loss = re.findall(r"is (\S+) to (\S+) %, of the loss factor up to (\S+)", line)[0]
    assert (float(low), float(high)) == pytest.approx((100.0 * np.min(ratio), 100.0 * np.max(ratio)), rel=0.05)
    assert float(loss) == pytest.approx(np.max(apart), rel=0.05)
    assert "damping at 75 Hz, axial at 0.2 mm, radial at 0.1 mm, torsion at 0.572958 deg" in text


def resting(model: Model, place: Direction, amplitude: float) -> float:
    """The force at the end of a triangular cycle of 10 mm/min or 10 deg/min."""
    rate = np.radians(10.0) / 60.0 if place.is_rotation else 1e-2 / 60.0
    triangle = amplitude * wave("triangle", np.arange(2000) / 2000)
    return float(model.force(place, History.steady(triangle, rate / (4.0 * amplitude))).max())


@pytest.mark.parametrize("export", WRITERS)
def test_every_deck_says_what_it_is_of_and_needs_a_direction(export, export_request):
    body = predict(export_request.result, Specimen("DMA =1+1", "modulus"), [5.0, 10.0], [0.01])
    exported = export(replace(export_request, units=MM_T_S_N, predictions=(body, *export_request.predictions)))
    assert "specimens: DMA =1+1" in map(str, exported.omissions)
    for content in exported.files.values():
        text = content.decode("ascii")
        for words in ("bushing: CMP 15 961", "model: model.json", f"sha256: {HASH}", "units: mm", "limit:"):
            assert words in text, words
    with pytest.raises(ModelError, match="no direction of a bushing"):
        export(replace(export_request, predictions=(body,)))


@pytest.mark.parametrize(("name", "at_most"), [("nastran", 0.006), ("optistruct", 0.006), ("abaqus", 0.06)])
def test_the_error_between_frequencies_that_is_told_is_the_one_there_is(name, at_most, export_request, tmp_path):
    """Read back, drawn as straight lines between the rows, and compared with the model, without its rig, everywhere."""
    rigged = Result(export_request.result.model.with_effect("rig_compliance", {"rig_compliance.compliance": 1e-7}))
    exported, found = read(
        name, replace(export_request, result=rigged, predictions=export_request.predictions[:1]), tmp_path
    )
    line = next(line for line in map(str, exported.omissions) if "between the frequencies" in line)
    claimed = float(line.split("up to ")[1].split(" %")[0]) / 100.0
    fine, worst = np.linspace(5.0, 155.0, 601), 0.0
    for (_, rank), (f, k) in found.items():
        amplitude = np.unique(export_request.predictions[0].amplitude)[rank - 1]
        off = drawn(name, f, k, fine) * 1e3 / export_request.result.model.stiffness("axial", fine, amplitude) - 1.0
        worst = max(worst, float(np.abs(off).max()))
    assert worst <= at_most
    assert worst == pytest.approx(claimed, rel=0.15)


def drawn(name: str, f: Array, k: Array, fine: Array) -> Array:
    """The stiffness that a solver takes between the rows of its tables."""
    if name == "abaqus":
        return np.interp(fine, f, k.real) + 2j * np.pi * fine * np.interp(fine, f, k.imag / (2.0 * np.pi * f))
    if name == "nastran":
        return np.interp(fine, f, k.real) * (1.0 + 1j * np.interp(fine, f, k.imag / k.real))
    return np.interp(fine, f, np.abs(k)) * np.exp(1j * np.interp(fine, f, np.angle(k)))
