"""One campaign of a laboratory through all commands: numbers meet the known truth, and are the same in all files."""

import json
import re
import shlex
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from unittest import mock

import commandline
import laboratory
import numpy as np
import pandas as pd
import pytest
from commandline import Done, Shared
from laboratory import COMPLIANCE, EFFECTS, RUBBER, truth
from reading_html import parsed

ALL = [word for direction in ("axial", "radial", "DMA") for word in ("--direction", direction)]
FIT = ("fit", "mount.toml", *ALL, "--no-plots", "--json", "-v", "-o", "fit")
Lab = Callable[..., tuple[Path, Done]]


@pytest.fixture(scope="module")
def lab(shared: Shared, tmp_path_factory) -> Lab:
    """Type a command in the folder of the laboratory; gives the folder and what was printed."""
    folder = tmp_path_factory.mktemp("laboratory")
    (folder / "plan.toml").write_text(laboratory.PLAN, encoding="utf-8")
    assert shared.call(folder, "simulate", "plan.toml", "-o", "sim").returncode == 0
    laboratory.rewrite_files(folder)

    @cache
    def run(*arguments: str, status: int = 0) -> tuple[Path, Done]:
        with mock.patch.object(commandline, "WIDTH", "120"):
            done = shared.call(folder, *arguments)
        assert done.returncode == status, done.stderr
        return folder, done

    return run


def complex_stiffness(table: pd.DataFrame, kind: str = "") -> np.ndarray:
    """Complex stiffness [N/mm] or modulus [MPa] of a table's columns, such as those of the model."""
    names = [name for name in (f"{kind}stiffness [N/mm]", f"{kind}modulus [MPa]") if name in table]
    size = table[names].bfill(axis=1).iloc[:, 0].to_numpy()
    angle = np.arctan(table[f"{kind}loss factor [-]"].to_numpy())
    return size * np.exp(1j * angle)


def true_stiffness(place: str, table: pd.DataFrame, **conditions: float) -> np.ndarray:
    """True complex stiffness [N/mm] or modulus [MPa] at the operating points of a table."""
    strain = place == "DMA"
    amplitude = table["strain amplitude [%]"] / 100.0 if strain else table["amplitude [mm]"] / 1e3
    return truth(place, table["frequency [Hz]"], amplitude, **conditions) / (1e6 if strain else 1e3)


#: Factors from SI units to those of the terminal.
UNITS = {"MPa": 1e-6, "MPa*s^alpha": 1e-6, "kPa": 1e-3, "-": 1.0, "1/K": 1.0, "mm/kN": 1e6}


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"(?<![\w.])[-+]?\d+\.?\d*(?:e-?\d+)?", text)]


def line(done: Done, start: str) -> str:
    """The only line of the terminal that begins with these words."""
    (found,) = [text.strip() for text in done.text.splitlines() if text.strip().startswith(start)]
    return found


def test_sweeps_meet_the_truth_in_the_order_of_their_files(lab):
    """Measured within noise of the truth, the model closer; test by test, the terminal has what the table says."""
    folder, done = lab(*FIT)
    table = pd.read_csv(folder / "fit/sweeps.csv")
    assert table["frequency [Hz]"][16:20].tolist() == [5.0, 20.0, 60.0, 150.0], "the second test, as stated"
    assert table["preload [mm]"].dropna().unique().tolist() == [1.5, 0.0, -1.5]
    for name, rows in table.groupby("sweep", sort=False):
        place = rows["direction"].iloc[0]
        conditions = {"rig": place != "DMA"}
        for key, column, scale in (("preload", "preload [mm]", 1e-3), ("temperature", "temperature [degC]", 1.0)):
            if rows[column].notna().all():
                conditions[key] = rows[column].iloc[0] * scale
        expected = true_stiffness(place, rows, **conditions)
        measured, model = complex_stiffness(rows), complex_stiffness(rows, "model ")
        assert abs(measured / expected - 1.0).max() < 0.015, name
        assert abs(model / expected - 1.0).max() < 0.004, name
        assert rows["measured over model [-]"].to_numpy() == pytest.approx(abs(measured / model), rel=1e-5)
        lag = rows["loss factor [-]"] - rows["model loss factor [-]"]
        assert rows["loss factor difference [-]"].to_numpy() == pytest.approx(lag.to_numpy(), abs=1e-6)
        points, nrmse, _, gap = numbers(line(done, f"{name}  ").removeprefix(name))
        assert points == len(rows)
        gain = abs(measured / model) - 1.0
        assert gap == pytest.approx(100.0 * gain.mean(), abs=0.01)
        assert nrmse == pytest.approx(100.0 * np.sqrt(np.mean(abs(measured / model - 1.0) ** 2)), abs=0.006), name


def test_parameters_meet_the_truth_and_are_the_same_in_all_files(lab):
    folder, done = lab(*FIT)
    printed = json.loads(done.stdout)["parameters"]
    saved = json.loads((folder / "fit/model.json").read_text(encoding="utf-8"))
    assert printed == saved["parameters"]
    record = "sim/loop_rear left axial_2.csv"
    assert re.findall("^input: (.*) sha256", done.text, re.MULTILINE).count("front.csv") == 1, "of three sweeps"
    assert [entry["file"] for entry in saved["provenance"]["inputs"]].count(record) == 1, "of two loops"
    covariance = dict(zip(saved["covariance"]["names"], np.diag(saved["covariance"]["matrix"]), strict=True))
    known = {**vars(RUBBER), **EFFECTS}
    assert set(printed) == {*known, "rig_compliance.compliance"}
    assert printed["rig_compliance.compliance"]["value"] == pytest.approx(COMPLIANCE)
    for name, expected in known.items():
        value, error, (low, high) = (printed[name][key] for key in ("value", "stderr", "ci95"))
        assert abs(value - expected) < 3.0 * error, name
        assert covariance[name] == pytest.approx(error**2, rel=1e-6)
        row = line(done, f"{name}{' (prior)' * name.startswith('stiffness_factor')}  ")
        words = row.removeprefix(name).removeprefix(" (prior)")
        scale = UNITS[words.split()[-1]]
        wanted = [scale * number for number in (value, error, low, high)]
        assert numbers(words)[:4] == pytest.approx(wanted, rel=0.05, abs=0.06 * scale * error), name
    assert line(done, "rig_compliance.compliance (fixed)").split()[2:] == ["0.01000", "mm/kN"]
    correlation = saved["covariance"]["matrix"][0][1] / np.sqrt(covariance["mu"] * covariance["m"])
    assert f"mu/m {correlation:+.2f}" in line(done, "correlation: ")


def test_shift_factors_master_curve_and_bushings_agree_with_the_parameters(lab):
    folder, done = lab(*FIT)
    shift = json.loads(done.stdout)["parameters"]["temperature.shift"]
    ratio = {name: -shift[key] * 17.0 / np.log(10.0) for name, key in (("", "value"), (", width", "stderr"))}
    cold, warm = pd.read_csv(folder / "fit/shift_factors.csv").to_dict("records")
    c2 = np.sqrt(np.log(10.0) * 17.44 * 51.6 / shift["value"])
    assert (cold["temperature [degC]"], warm["temperature [degC]"], cold["log10 a_T [-]"]) == (23.0, 40.0, 0.0)
    assert warm["log10 a_T [-]"] == pytest.approx(ratio[""] * c2 / (c2 + 17.0), rel=1e-4)
    assert warm["log10 a_T [-], low"] < np.log10(np.exp(-laboratory.SHIFT * 15.97)) < warm["log10 a_T [-], high"]
    curve = pd.read_csv(folder / "fit/master_curve.csv").query("`temperature [degC]` == 40")
    reduced = curve["reduced frequency [Hz]"] / curve["frequency [Hz]"]
    assert reduced.to_numpy() == pytest.approx(10.0 ** warm["log10 a_T [-]"], rel=1e-4)
    for row in pd.read_csv(folder / "fit/bushings.csv").to_dict("records"):
        words = line(done, f"{row['bushing']}  ").removeprefix(row["bushing"])
        wanted = [row[name] for name in ("points", "NRMSE [%]", "chi2 [-]", "mean gap [%]", "in band [%]")]
        assert numbers(words) == pytest.approx(wanted, rel=0.04)


@pytest.mark.parametrize(
    ("name", "options", "conditions"),
    [
        ("front axial", ("--preload", "-0.5 mm"), {"preload": -0.5e-3}),
        ("front axial", ("--preload", "1 mm", "--temperature", "35 degC"), {"preload": 1e-3, "temperature": 35.0}),
        ("rear left radial", ("--temperature", "40 degC"), {"temperature": 40.0}),
        ("rear left axial", ("--amplitudes", "0.3, 0.1 mm", "--frequencies", "100, 10 Hz"), {}),
        ("DMA", ("--strain-amplitudes", "1, 5 %"), {}),
    ],
)
def test_predictions_meet_the_truth_within_their_bands(lab, name, options, conditions):
    """Without the rig; the terminal has the first and last frequency of the table, and so has the document."""
    lab(*FIT)
    out = re.sub(r"\W+", "_", f"out {name} {' '.join(options)}")
    folder, done = lab("predict", "fit", "--direction", name, *options, "--no-plots", "--json", "-o", out)
    table, document = pd.read_csv(folder / out / f"{name}.csv"), json.loads(done.stdout)[name]
    unit, amplitude = (
        ("modulus [MPa]", "strain amplitude [%]") if name == "DMA" else ("stiffness [N/mm]", "amplitude [mm]")
    )
    for column in (unit, "loss factor [-]", amplitude):
        assert document[column] == pytest.approx(table[column].tolist(), rel=1e-5)
    expected = true_stiffness(name, table, **conditions)
    assert abs(complex_stiffness(table) / expected - 1.0).max() < 0.006
    for column, true in ((unit, abs(expected)), ("loss factor [-]", expected.imag / expected.real)):
        wide = 0.5 * (table[f"{column}, high"] - table[f"{column}, low"])
        assert (abs(table[column] - true) < 1.6 * wide).all(), column
        assert (wide < 0.1 * table[column]).all()
    ends = table[table["frequency [Hz]"].isin([table["frequency [Hz]"].min(), table["frequency [Hz]"].max()])]
    rows = [found for text in done.text.splitlines() if len(found := numbers(text)) == 8 and "(" in text]
    columns = [unit, f"{unit}, low", f"{unit}, high", *(f"loss factor [-]{end}" for end in ("", ", low", ", high"))]
    wanted = ends[["frequency [Hz]", amplitude, *columns]].to_numpy()
    assert np.array(rows) == pytest.approx(wanted, rel=0.006)
    warm, preload = conditions.get("temperature", 23.0), conditions.get("preload")
    at = f"{warm:g} degC" if preload is None else f"a preload of {1e3 * preload:g} mm and {warm:g} degC"
    assert f"{name} at {at}: " in done.text
    assert set(table["temperature [degC]"]) == {warm}
    assert preload is None or (table["preload [mm]"] == 1e3 * preload).all()


def test_a_measured_record_is_met_by_respond_and_validation(lab):
    """The record of the simulated rig, in both commands; run finds nothing else, and its page has the same numbers."""
    lab(*FIT)
    record = "sim/record_front axial.csv"
    respond = ("respond", "fit", record, "--direction", "front axial", "--no-plots", "--json", "-o", "response")
    folder, done = lab(*respond)
    table, measured = pd.read_csv(folder / "response/response.csv"), pd.read_csv(folder / record)
    force = table["force [N]"]
    assert np.std(force - measured["force [N]"]) < 0.006 * np.ptp(force)
    assert "front axial at a preload of 0 mm and 23 degC over" in done.text
    peak, rms, power, strain = numbers(line(done, "front axial  "))[:4]
    assert (peak, rms) == pytest.approx((abs(force).max(), np.sqrt(np.mean(force**2))), rel=1e-3)
    motion = table["displacement [mm]"]
    work = np.trapezoid(force, motion) / 1e3
    assert power == pytest.approx(work / table["time [s]"].iloc[-1], rel=0.01)
    unit = 1.0 / np.sqrt(2.0 * (0.018**2 - 0.010**2) * np.log(1.8))
    assert strain == pytest.approx(100.0 * unit * abs(motion).max() / 1e3, rel=0.01)

    folder, done = lab("run", "mount.toml", "--no-plots", "-o", "run")
    row = pd.read_csv(folder / "run/validation.csv").iloc[0]
    record = pd.read_csv(folder / "run/validation_record_front axial.csv")
    error = record["force [N]"] - record["measured force [N]"]
    assert row["NRMSE [%]"] == pytest.approx(200.0 * error.std() / np.ptp(record["measured force [N]"]), rel=0.01)
    band = record["measured force [N]"].between(record["force [N], low"], record["force [N], high"])
    assert row["points in band [%]"] == pytest.approx(100.0 * band.mean(), abs=3.0)
    names = ("NRMSE [%]", "peak gap [%]", "energy gap [%]", "points in band [%]")
    assert numbers(line(done, "record_front axial  "))[-4:] == pytest.approx([row[name] for name in names], rel=0.01)
    assert "mount 7: consistent" in done.text
    missed = "rear 40 degC, rear left radial, was not fitted, and the model misses it by 5."
    assert missed in done.text
    assert "fit both directions (--direction axial --direction radial)" in done.text
    model = json.loads((folder / "run/model.json").read_text(encoding="utf-8"))["parameters"]
    page = parsed((folder / "run/report.html").read_text(encoding="utf-8")).text
    assert f"{1e-6 * model['mu']['value']:.4f}" in page
    for place, preload in (("front axial", "preload 0 mm, "), ("rear left radial", "")):
        words = page.partition(f" {place} 20 Hz ")[2]
        assert f"mm {preload}23 °C" in words[:40]
        amplitude, stiffness, low, high, loss, _, *loss_band = numbers(words.replace(f"{preload}23 °C", "", 1))[:8]
        table = pd.read_csv(folder / f"run/{place}.csv").set_index(["frequency [Hz]", "amplitude [mm]"])
        row = table.loc[(20.0, amplitude)]
        wanted = [row[f"stiffness [N/mm]{end}"] for end in ("", ", low", ", high")]
        assert [stiffness, low, high] == pytest.approx(wanted, rel=2e-4)
        wanted = [row[f"loss factor [-]{end}"] for end in ("", ", low", ", high")]
        assert [loss, *loss_band] == pytest.approx(wanted, rel=5e-3)


def test_compared_with_the_truth_nothing_differs(lab):
    lab(*FIT)
    folder, done = lab("compare", "fit", "sim/truth.json", "--no-plots", "--json", "-o", "compared")
    table = pd.read_csv(folder / "compared/differences.csv")
    assert set(table["direction"]) == {"front axial", "rear left axial", "rear left radial", "DMA"}
    for place, rows in table.groupby("direction"):
        expected = true_stiffness(place, rows)
        assert abs(complex_stiffness(rows, "other ") / expected - 1.0).max() < 0.004
        assert abs(complex_stiffness(rows, "reference ") / expected - 1.0).max() < 0.006
        kind = "modulus" if place == "DMA" else "stiffness"
        ratio = abs(complex_stiffness(rows, "other ")) / abs(complex_stiffness(rows, "reference ")) - 1.0
        column = f"relative difference of {kind} [-]"
        assert rows[column].to_numpy() == pytest.approx(ratio, abs=2e-6)
        assert (rows[f"{column}, significant"] == "no").all()
    fitted = json.loads((folder / "fit/model.json").read_text(encoding="utf-8"))["parameters"]
    parameters = pd.read_csv(folder / "compared/parameters.csv").set_index("parameter")
    for name, expected in {**vars(RUBBER), **EFFECTS}.items():
        row = parameters.loc[name]
        assert (row["reference value"], row["other value"]) == pytest.approx(
            (fitted[name]["value"], expected), rel=1e-6
        )
    (pair,) = json.loads(done.stdout)["pairs"]
    assert line(done, "all 14 together").endswith(f"p {pair['joint']['p']:.2g}")


def test_the_batch_and_the_exported_tables_have_the_numbers_of_the_single_commands(lab):
    """One row with the fit, the operating points, and a limit each that is met and missed."""
    folder, done = lab(*FIT)
    fitted = json.loads(done.stdout)
    grid = ("--direction", "front", "--frequencies", "60, 20 Hz", "--amplitudes", "0.4, 0.1 mm")
    lab("predict", "fit", *grid, "--no-plots", "-o", "grid")
    lab("export", "fit", *grid, "--format", "csv", "-o", "exported")
    table = pd.read_csv(folder / "grid/front axial.csv")
    exported = pd.read_csv(folder / "exported/front_axial.csv")
    for column in set(table) & set(exported):
        assert exported[column].to_numpy() == pytest.approx(table[column].to_numpy(), rel=1e-5, nan_ok=True)
    point, name = table.set_index(["frequency [Hz]", "amplitude [mm]"]).loc[(60.0, 0.4)], "front axial 60 Hz 0.4 mm"
    value = point["stiffness [N/mm]"]
    limits = f'[parameters.alpha]\nmax = 0.4\n[[stiffness]]\nat = "{name}"\nmin = "{value - 1.0:.1f} N/mm"\n'
    limits += f'[[loss_factor]]\nat = "{name}"\nmax = 0.12\n'
    (folder / "limits.toml").write_text(limits, encoding="utf-8")
    batch = ("batch", "mount.toml", *ALL, "--command", "fit", "--at", name, "--at", "DMA 10 Hz 1 %")
    _, done = lab(*batch, "--limits", "limits.toml", "--jobs", "1", "--no-plots", "-o", "batch", status=1)
    (row,) = pd.read_csv(folder / "batch/batch.csv").to_dict("records")
    for parameter, entry in fitted["parameters"].items():
        (header,) = [column for column in row if re.fullmatch(rf"{re.escape(parameter)} \[[^\]]*\]", column)]
        scale = UNITS[header.partition("[")[2].rstrip("]")]
        assert row[header] == pytest.approx(scale * entry["value"], rel=1e-5)
        if entry["stderr"]:
            assert row[f"{header}, high"] == pytest.approx(scale * entry["ci95"][1], rel=1e-4)
    assert row["NRMSE [%]"] == pytest.approx(100.0 * fitted["fit"]["nrmse"], rel=1e-4)
    assert row[f"stiffness {name} [N/mm]"] == pytest.approx(value, rel=1e-5)
    assert row[f"loss factor {name} [-]"] == pytest.approx(point["loss factor [-]"], rel=1e-5)
    coupon = truth("DMA", [10.0], [0.01])[0]
    assert row["stiffness DMA 10 Hz 1 % [MPa]"] == pytest.approx(1e-6 * abs(coupon), rel=0.005)
    said = " ".join(done.text.split())
    assert f"mount fails: loss factor {name} {point['loss factor [-]']:.4g}" in said
    assert "1 fail" in said


def test_a_resonance_test_is_reduced_to_the_stiffness_of_the_specimen(lab):
    """The command that simulate writes into its campaign."""
    folder, _ = lab(*FIT)
    text = (folder / "sim/campaign.toml").read_text(encoding="utf-8")
    assert [body.get("factor") for body in tomllib.loads(text)["bushings"]] == [None, "free"]
    (*_, last) = re.findall(r"^# bushfit (reduce .*)$", text, re.MULTILINE)
    command = shlex.split(last)
    command[1] = f"sim/{command[1]}"
    lab(*command)
    table = pd.read_csv(folder / command[-1] / "sweep.csv")
    expected = truth("pad", table["frequency [Hz]"], table["amplitude [mm]"] / 1e3) / 1e3
    off = complex_stiffness(table) / expected - 1.0
    assert (abs(off) < 4.0 * table["relative error [-]"] + 0.004).all()
    assert abs(off).min() < 0.01
    assert table["frequency [Hz]"].is_monotonic_increasing


def test_inspect_gives_each_test_of_a_file_with_its_units(lab):
    files = ("front.csv", "rear.csv", "loop_front.csv", "sim/loop_rear left axial_2.csv")
    _, done = lab("inspect", *files, "--no-plots", "-o", "seen")
    text = " ".join(done.text.split())
    assert text.count('amplitudes: 0.1, 0.4 mm zero-to-peak, half of "Displacement p-p [mil]"') == 3
    assert text.count("amplitudes: 0.05, 0.2 mm zero-to-peak") == 2
    assert "programme: 2 loops in one record: 0.3, 0.9 mm at 0.2 Hz" in text
    assert "frequency: 0.1 Hz, a sine" in text
    keys = re.findall(r'(?:preload|temperature) = "[^"]*"', done.text)
    assert keys == [
        *(f'preload = "{n} mm"' for n in ("-1.5", "0", "1.5")),
        *(f'temperature = "{n} degC"' for n in ("23.0", "40.0")),
    ]


@pytest.mark.parametrize(
    ("preload", "status", "problem"),
    [("300 N", 2, "found: -1.5, 0, 1.5 mm expected: a preload in mm, as in the file"), ("none", 0, "front none")],
)
def test_a_stated_preload_is_one_of_those_in_the_file(lab, preload, status, problem):
    folder, _ = lab(*FIT)
    text = (folder / "mount.toml").read_text(encoding="utf-8").replace('"0 mm"', f'"{preload}"')
    (folder / f"{preload}.toml").write_text(text, encoding="utf-8")
    options = ("--direction", "front", "--no-plots", "-o", preload)
    _, done = lab("fit", f"{preload}.toml", *options, status=status)
    assert problem in " ".join(done.text.split())
    if not status:
        table = pd.read_csv(folder / preload / "sweeps.csv")
        assert [header for header in table if header.startswith("preload")] == ["preload [mm]"]
