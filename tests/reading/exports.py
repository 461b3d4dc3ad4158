"""Files as laboratories and test machines write them, with the test in each or the question that it raises."""

import numpy as np
from export_tables import (
    DAMPING,
    DISPLACEMENT,
    ETA,
    EXCEL_DAYS,
    FORCE,
    LVM,
    LVM_NO_X,
    MODULUS,
    MTS793,
    ONE_HZ,
    PHASE,
    RHEO,
    STIFFNESS,
    T10,
    TIME,
    USUAL,
    A,
    Export,
    F,
    G,
    K,
    blocks,
    clock,
    loop,
    sweep,
    table,
)
from instrument_exports import INSTRUMENT_EXPORTS

EXPORTS: dict[str, Export] = {
    # sweeps that have other columns too
    "displacement and force of the points": Export(
        sweep("Frequency [Hz]|Displacement [mm]|Force [N]|K* [N/mm]|Loss angle [deg]", F, A, K * A, K, PHASE)
    ),
    "mean position and load": Export(
        sweep("Frequency (Hz)|Amplitude (mm)|Position (mm)|Load (N)|K* (N/mm)|Phase (deg)", F, A, 0 * F + 3.2, 0 * F + 512, K, PHASE)
    ),
    "position that is no amplitude": Export(
        sweep("Frequency [Hz]|Displacement [mm]|Force [N]|K* [N/mm]|Loss angle [deg]", F, 0 * F + 3.1, 0 * F + 512.3, K, PHASE),
        None, ["amplitude"],
    ),
    "strain and stress of the points": Export(
        sweep("Time [s]|Shear strain [%]|Shear stress [kPa]|G' [MPa]|G'' [MPa]", 12 * np.arange(10), 10 * A, A * 100 * np.abs(G), G.real, G.imag),
        stated={"at_frequency": "1 Hz"}, reference=ONE_HZ,
    ),
    "RheoCompass with waveforms": Export(RHEO, words=["rows left out"], reference=MODULUS),
    # hints that misled
    "omega without unit": Export(sweep("omega|Amplitude [mm]|K* [N/mm]|tan delta", 2 * np.pi * F, A, K, ETA), None, ["rad/s"]),
    "omega with the unit of the hint": Export(
        sweep("omega|Amplitude [mm]|K* [N/mm]|tan delta", 2 * np.pi * F, A, K, ETA), stated={"units": {"frequency": "rad/s"}}
    ),
    "log10 f": Export(sweep("log10 f [Hz]|Amplitude [mm]|K* [N/mm]|tan delta", np.log10(F), A, K, ETA)),
    "log10(K*/(N/m))": Export(sweep("log10(f/Hz)|x0 [mm]|log10(K*/(N/m))|delta [°]", np.log10(F), A, np.log10(1e3 * K), PHASE)),
    "log f": Export(sweep("log f [Hz]|Amplitude [mm]|K* [N/mm]|tan delta", np.log10(F), A, K, ETA), None, ["log10(Hz)", "ln(Hz)"]),
    "log f, as the hint says": Export(
        sweep("log f [Hz]|Amplitude [mm]|K* [N/mm]|tan delta", np.log10(F), A, K, ETA), stated={"units": {"frequency": "log10(Hz)"}}
    ),
    **{
        header: Export(sweep(f"Frequency [Hz]|{header}|K* [N/mm]|tan delta", F, factor * A, K, ETA))
        for header, factor in (
            ("Amplitude RMS [mm]", 0.5**0.5), ("Amplitude eff. [mm]", 0.5**0.5), ("Amp [mm rms]", 0.5**0.5),
            ("AmpPkPk(mm)", 2.0), ("DA [mm]", 2.0), ("Amplitude (2a) [mm]", 2.0), ("Amplitude max-min [mm]", 2.0),
            ("Amplitude total [mm]", 2.0), ("Double amplitude (mm)", 2.0), ("DispPkPk [mm]", 2.0),
            ("Ampl. DA (mm)", 2.0), ("Xpp [mm]", 2.0), ("Xrms [mm]", 0.5**0.5), ("x [mm]", 1.0),
            ("Amplitude [±mm]", 1.0), ("Amplitude (mm pk)", 1.0), ("Amplitude peak [mm]", 1.0), ("±Displacement [mm]", 1.0),
        )
    },
    "amplitudes stated as rms": Export(
        sweep("Frequency [Hz]|Amplitude [mm]|K* [N/mm]|tan delta", F, 0.5**0.5 * A, K, ETA), stated={"amplitude": "rms"}
    ),
    "damping": Export(sweep(USUAL + "Damping [-]", F, A, K, ETA), None, ["loss_factor", "damping_ratio"]),
    "peak to peak in running text": Export(
        "EPDM bushing at 23 degC, 0.4 mm peak-to-peak\n" + sweep("f [Hz]|K* [N/mm]|tan delta", *(x[A == 0.1] for x in (F, K, ETA))),
        words=["amplitude 0.2 mm, half of 0.4 mm", "temperature 23 degC"],
        reference={"frequency": F[A == 0.1], "amplitude": 0 * F[A == 0.1] + 2e-4, "stiffness": 1e3 * STIFFNESS[A == 0.1]},
    ),
    **{
        f"convert {header}": Export(sweep(f"f [Hz]|A [mm]|K* [N/mm]|{header}", F, A, K, ETA), None, [words])
        for header, words in (("Dissipated energy [mJ]", "loss stiffness [N/mm]"), ("psi [-]", "damping_ratio = "), ("Impedance [N s/mm]", "damping_ratio = "))
    },
    "maximum and minimum": Export(sweep("f [Hz]|Max Disp (mm)|Min Disp (mm)|Phase (deg)", F, A, -A, PHASE), None, ["half of maximum minus minimum"]),
    "stated as peak-to-peak": Export(
        sweep("f [Hz]|K* [N/mm]|tan delta", *(x[A == 0.1] for x in (F, K, ETA))), stated={"at_amplitude": "0.4 mm p-p"},
        reference={"frequency": F[A == 0.1], "amplitude": 0 * F[A == 0.1] + 2e-4, "stiffness": 1e3 * STIFFNESS[A == 0.1]},
    ),
    "D": Export(sweep(USUAL + "D [-]", F, A, K, ETA), None, ["loss_factor", "damping_ratio"]),
    "d is a damping coefficient by its unit": Export(sweep("f [Hz]|s0 [mm]|c* [N/mm]|d [N s/mm]", F, A, K, DAMPING), words=["by its unit"]),
    "snake case": Export(sweep("freq_hz|amp_um_pp|kdyn_n_per_mm|loss_angle_deg", F, 2e3 * A, K, PHASE)),
    "cycle rate": Export(sweep("Cycle rate [cpm]|Amplitude [mm]|K* [N/mm]|tan delta", 60 * F, A, K, ETA)),
    "a static stiffness": Export(sweep("f [Hz]|A [mm]|Cstat [N/mm]|tan delta", F, A, K, ETA), None, ["understood: frequency, amplitude, loss factor"]),
    "a size of zero, marked numbers and names of intervals": Export(
        sweep(USUAL + "tan delta|Point", F, A, K, ETA, 0 * F) + "85\t0.5\t0\t0.1\t0\n90\t0.5\t673.5*\t0.1\t0\nInterval and data:\t2\t5\n",
        words=["3 rows left out", "(85, 0.5, 0", "(90, 0.5, 673.5*", "(Interval and data:"],
    ),
    "damping is a loss factor": Export(
        sweep(USUAL + "Damping [-]", F, A, K, ETA), stated={"columns": {"loss_factor": "Damping [-]"}}
    ),
    "damping is a damping ratio": Export(
        sweep(USUAL + "Damping [-]", F, A, K, ETA / 2), stated={"columns": {"damping_ratio": "Damping [-]"}}
    ),
    "damping ratio": Export(sweep(USUAL + "Damping ratio [%]", F, A, K, 50 * ETA)),
    # damping coefficients
    "damping coefficient beside a phase": Export(
        sweep("Freq (Hz)|Amplitude (mm)|K* (N/mm)|Phase (deg)|Damping (N-s/mm)", F, A, K, PHASE, DAMPING)
    ),
    "damping coefficient alone": Export(sweep("Freq [Hz]|Amplitude [mm]|K' [N/mm]|C [N*s/mm]", F, A, STIFFNESS.real, DAMPING)),
    "magnitude and damping coefficient": Export(sweep("Freq [Hz]|Amplitude [mm]|K* [N/mm]|C (Ns/mm)", F, A, K, DAMPING)),
    "MTS elastomer": Export(T10),
    # rows that are no data, and blocks
    "blocks with amplitudes": Export(blocks("Amplitude: {} mm".format, "f [Hz]|K* [N/mm]|tan delta")),
    "blocks with amplitudes and one header": Export(
        "f [Hz]\tK* [N/mm]\ttan delta\n" + "\n".join(
            line for line in blocks("Amplitude: {} mm".format, "f [Hz]|K* [N/mm]|tan delta").splitlines() if line[0] != "f"
        ), words=[],
    ),
    "blocks, means, and an end": Export(
        blocks("Amplitude:\t{}\tmm".format, "f [Hz]|K* [N/mm]|tan delta", end=["Mean\t1450\t0.12", "Std\t10\t0.01", "---", "End of test"]),
        words=["7 rows left out", "Mean"],
    ),
    "means": Export(sweep(USUAL + "tan delta", F, A, K, ETA) + "Mean\t0.3\t1400\t0.13\nStd Dev\t0.1\t20\t0.01\n", words=["2 rows left out"]),
    "a mean below a column of names": Export(
        sweep("Specimen|" + USUAL + "tan delta", ["P1"] * F.size, F, A, K, ETA) + "Mean\t30\t0.3\t1400\t0.13\n", words=["1 row left out", "Mean"]
    ),
    "a second block in German": Export(loop() + loop("Zeit [s]|Weg [mm]|Kraft [N]"), "loop"),
    "a second block in German, in N/m": Export(
        sweep(USUAL + "tan delta", F[:5], A[:5], K[:5], ETA[:5]) + sweep("Frequenz [Hz]|Amplitude [mm]|Steifigkeit [N/m]|Verlustfaktor", F[5:], A[5:], 1e3 * K[5:], ETA[5:]),
        None, ["the stiffness has two units", "N/mm on line 1"],
    ),
    "missing values": Export(
        sweep(USUAL + "tan delta", F, A, K, ETA) + "90\t0.1\tNaN\t0.1\n100\t0.1\t#N/A\t0.1\n", words=["2 rows left out"]
    ),
    "MTS793, nine acquisitions": Export(MTS793, "loop", name="loop.dat"),
    "means under a unit's symbol": Export(sweep(USUAL + "tan delta", F, A, K, ETA) + "MW\t\t1\t1\n", words=["line 12 (MW, 1, 1)"]),
    "means under a unit's symbol, between blocks": Export(
        "".join(sweep(USUAL + "tan delta", F[n], A[n], K[n], ETA[n]) + "MW\t\t1\t1\n" for n in (slice(5), slice(5, None))),
        words=["2 rows left out", "row 14 (MW, 1, 1"],
    ),
    "end of a loop": Export(loop() + "End of test\n---\n\tNaN\tNaN\n", "loop", ["rows left out"]),
    # sign and range of phases
    **{
        f"phases {what}": Export(sweep(USUAL + "Phase [deg]", F, A, K, phase), words=[word])
        for what, phase, word in (
            ("negative", -PHASE, "phase_sign"), ("near -174", PHASE - 180, "force_sign"), ("near 174", 180 - PHASE, "force_sign"),
            ("near 354", 360 - PHASE, "wrapped"), ("near 366", 360 + PHASE, "wrapped"), ("near 186", 180 + PHASE, "force_sign"),
        )
    },
    "loss factors negative": Export(sweep(USUAL + "tan delta", F, A, K, -ETA), words=["phase_sign"]),
    "loss stiffness negative": Export(sweep("f [Hz]|A [mm]|K' [N/mm]|K'' [N/mm]", F, A, STIFFNESS.real, -STIFFNESS.imag), words=["phase_sign"]),
    # time
    "clock": Export(loop("Time|Displacement [mm]|Force [N]", [clock(t, "{h:02d}:{m:02d}:{s:06.3f}") for t in TIME], DISPLACEMENT, FORCE), "loop"),
    "ISO": Export(loop("Timestamp|Displacement [mm]|Force [N]", ["2026-11-26T" + clock(t, "{h:02d}:{m:02d}:{s:06.3f}") for t in TIME], DISPLACEMENT, FORCE), "loop"),
    "ISO with zone and blanks": Export(loop("Date Time|Displacement [mm]|Force [N]", ["2026-11-26 " + clock(t, "{h:02d}:{m:02d}:{s:06.3f}+01:00") for t in TIME], DISPLACEMENT, FORCE), "loop"),
    "date and time": Export(loop("Date|Time|Displacement [mm]|Force [N]", ["26.11.2026"] * 600, [clock(t, "{h:02d}:{m:02d}:{s:06.3f}") for t in TIME], DISPLACEMENT, FORCE), "loop"),
    "AM and PM": Export(loop("Time|Displacement [mm]|Force [N]", ["11/26/2026 " + clock(t, "{h12}:{m:02d}:{s:06.3f} PM") for t in TIME], DISPLACEMENT, FORCE, mark=";"), "loop"),
    "clock with a comma": Export(
        "Uhrzeit;Weg [mm];Kraft [N]\n" + "\n".join(
            ";".join([clock(t, "{h:02d}:{m:02d}:{s:06.3f}"), f"{x:.6f}", f"{y:.4f}"]).replace(".", ",")
            for t, x, y in zip(TIME, DISPLACEMENT, FORCE, strict=True)
        ), "loop",
    ),
    "rounded stamps": Export(loop("Time|Displacement [mm]|Force [N]", [clock(t, "{h:02d}:{m:02d}:{s:06.3f}")[:8] for t in TIME], DISPLACEMENT, FORCE), "loop", ["spread evenly"]),
    "rounded seconds": Export(loop("time [s]|displacement [mm]|force [N]", [f"{t:.1f}" for t in TIME - 0.001], DISPLACEMENT, FORCE), "loop", ["spread evenly"]),
    "day numbers": Export(loop("Time|Displacement [mm]|Force [N]", [f"{d:.10f}" for d in EXCEL_DAYS], DISPLACEMENT, FORCE), "loop"),
    "day numbers as seconds": Export(
        loop("Time|Displacement [mm]|Force [N]", [f"{d:.10f}" for d in EXCEL_DAYS], DISPLACEMENT, FORCE), None, ["day numbers"], {"units": {"time": "s"}}
    ),
    "day numbers as days": Export(
        loop("Time|Displacement [mm]|Force [N]", [f"{d:.10f}" for d in EXCEL_DAYS], DISPLACEMENT, FORCE), "loop", (), {"units": {"time": "d"}}
    ),
    # columns
    **{
        f"columns by unit: {headers}": Export(loop(headers), "loop")
        for headers in ("t [s]|LVDT 2 [mm]|Load Cell [N]", "Time (s)|x (mm)|Fz (N)", "t[s]|s1[mm]|MGC Kanal 3[N]")
    },
    "two columns by unit": Export(
        loop("Time [s]|LVDT 1 [mm]|Fx [N]|Fz [N]", TIME, DISPLACEMENT, 0.1 * FORCE, FORCE), None, ['--column "force=Fx [N]"', '--column "force=Fz [N]"'],
    ),
    **{
        f"unit {unit}": Export(sweep(f"Frequency [{hz}]|Amplitude [mm]|K* [{unit}]|tan delta", factor * F, A, K, ETA))
        for unit, hz, factor in (("N mm-1", "Hz", 1), ("N.mm-1", "cpm", 60), ("N mm^-1", "cps", 1))
    },
    "real and imaginary": Export(sweep("f [Hz]|A [mm]|K real [N/mm]|K imag [N/mm]", F, A, STIFFNESS.real, STIFFNESS.imag)),
    "Re and Im": Export(sweep("f [Hz]|A [mm]|Re(K*) [N/mm]|Im(K*) [N/mm]", F, A, STIFFNESS.real, STIFFNESS.imag)),
    "force and displacement amplitudes": Export(sweep("f [Hz]|Displacement amplitude [mm]|Force amplitude [N]|Phase [deg]", F, A, K * A, PHASE)),
    "F and x": Export(sweep("f [Hz]|x [mm]|F [N]|phase [deg]", F, A, K * A, PHASE)),
    "force and displacement p-p": Export(sweep("f [Hz]|Disp p-p [mm]|Force p-p [kN]|Phase [deg]", F, 2 * A, 2 * K * A / 1e3, PHASE)),
    "LabVIEW": Export(LVM, "loop", name="loop.lvm"),
    "LabVIEW without X": Export(LVM_NO_X, "loop", name="loop.lvm"),
    "LabVIEW, decimal comma": Export(
        LVM.replace("Decimal_Separator\t.", "Decimal_Separator\t,").replace("0.0", "0,0").replace("\t-0.", "\t-0,").replace(".", ","), "loop", name="loop.lvm"
    ),
    "names of rows": Export(
        "\n".join(["Frequency [Hz]\tAmplitude [mm]\tK* [N/mm]\ttan delta", *(f"{n}\t{line}" for n, line in enumerate(table([], F, A, K, ETA)[1:], 1))])
    ),
    "unnamed last column": Export("\n".join(["time [s],displacement [mm],force [N]", *(",".join(f"{v:.6f}" for v in (t, x, y, 23.0)) for t, x, y in zip(TIME, DISPLACEMENT, FORCE, strict=True))]), "loop", name="loop.csv"),
    "no header": Export("\n".join(table([], TIME, DISPLACEMENT, FORCE)[1:]), None, ['columns = { time = "1"', "no header"]),
    "no header, columns by number": Export(
        "\n".join(table([], TIME, DISPLACEMENT, FORCE)[1:]), "loop", (),
        {"columns": {"time": "1", "displacement": "2", "force": "3"}, "units": {"time": "s", "displacement": "mm", "force": "N"}},
    ),
    "equal headers, column by number": Export(
        loop("time [s]|displacement [mm]|force [N]|force [N]", TIME, DISPLACEMENT, FORCE, 0.5 * FORCE), "loop", (), {"columns": {"force": "3"}}
    ),
    # numbers and contradictions
    "one cell in another format": Export(
        sweep("Frequency [Hz]|Amplitude [mm]|K* [N/mm]|tan delta", F, A, [f"{k - 800:.3f}" if n != 3 else f"{k - 800:.3f}".replace(".", ",") for n, k in enumerate(K)], ETA, mark=";"),
        None, ["another format"],
    ),
    "amplitudes that contradict": Export(
        sweep("f [Hz]|amplitude [mm]|Amplitude p-p [mm]|K* [N/mm]|tan delta", F, A, A, K, ETA), None, ["contradict"]
    ),
    "amplitudes that agree": Export(sweep("f [Hz]|amplitude [mm]|Amplitude p-p [mm]|K* [N/mm]|tan delta", F, A, 2 * A, K, ETA)),
    "one header for two roles": Export(
        loop(), None, ["two roles"], {"columns": {"force": "displacement [mm]", "displacement": "displacement [mm]"}}
    ),
    # more exports
    "force amplitude beside a displacement p-p": Export(
        sweep("Frequency [Hz]|Displacement p-p [mm]|Force amplitude [N]|Phase [deg]", F, 2 * A, K * A, PHASE), None, ['"N 0-p"'],
    ),
    "force amplitude, as the hint says": Export(
        sweep("Frequency [Hz]|Displacement p-p [mm]|Force amplitude [N]|Phase [deg]", F, 2 * A, K * A, PHASE),
        stated={"units": {"force_amplitude": "N 0-p"}},
    ),
    "units row with conventions": Export("Freq\tAmp\tStiffness\tPhase\nHz\tmm pk-pk\tN mm-1\t°\n" + "\n".join(table([], F, 2 * A, K, PHASE)[1:])),
    "Servotest": Export(
        "Servotest Pulsar,Test 3\nDate,26/11/2026\n\n"
        + sweep("Frequency (Hz)|Amplitude (+/-mm)|Dynamic Stiffness (N/mm)|Loss Angle (deg)|Damping (Ns/mm)|Static Load (N)", F, A, K, PHASE, DAMPING, 0 * F + 500, mark=",")
    ),
    "past midnight": Export(
        loop("Time|Displacement [mm]|Force [N]", [f"23:59:{45 + t:06.3f}" if t < 15 else f"00:00:{t - 15:06.3f}" for t in TIME], DISPLACEMENT, FORCE), "loop"
    ),
    "Kraftamplitude": Export(
        sweep("Frequenz [Hz]|Wegamplitude SS [mm]|Kraftamplitude SS [N]|Phasenwinkel [°]", F, 2 * A, 2 * K * A, PHASE, mark=";").replace(".", ",")
    ),
    "tan(delta)/%": Export(sweep("f/Hz|A/mm|K*/(N/mm)|tan(delta)/%", F, A, K, 100 * ETA)),
    "rows and columns exchanged": Export("Frequency [Hz],5,10,20,40\nStiffness [N/mm],594,608,627,640\nLoss factor,0.1,0.11,0.12,0.13\n", None, ["the amplitude of this test is not stated"]),
    "a quality factor": Export(sweep(USUAL + "Q [-]", F, A, K, 1 / ETA), None, ["the columns are not those of a test"]),
    "logarithms of a DMA": Export(
        sweep("log10(f/Hz)|Strain [%]|log10 G' [Pa]|log10 G'' [Pa]", np.log10(F), 10 * A, np.log10(1e6 * G.real), np.log10(1e6 * G.imag)), reference=MODULUS
    ),
    "a comma before the convention": Export(sweep("Freq. (Hz)|Dyn. Disp. (mm, 0-pk)|Static Disp (mm)|Kd (N/mm)|Loss Angle (deg)", F, A, 0 * F + 2, K, PHASE)),
    "Vpp": Export(sweep("f [Hz]|Disp Vpp (mm)|K* [N/mm]|tan delta", F, 2 * A, K, ETA)),
    "Cdyn is a damping": Export(sweep("Frequency,Hz|Amp,mm|Kdyn,N/mm|Cdyn,N·s/mm", F, A, K, DAMPING)),
    "kNs/m": Export(sweep("f [Hz]|A [mm]|K [kN/m]|c [kNs/m]", F, A, K, DAMPING)),
    "blocks with an amplitude after a colon": Export(blocks("Level 1: ±{} mm".format, "f [Hz]|K* [N/mm]|tan delta")),
    "blocks without a unit": Export(blocks("Amplitude {}".format, "f [Hz]|K* [N/mm]|tan delta"), None, ['rows = { block = "1" }']),
    "an angle is the phase": Export(sweep(USUAL + "Angle force/disp [deg]", F, A, K, PHASE), words=["by its unit"]),
    "phase without unit": Export(sweep(USUAL + "Phase", F, A, K, PHASE), None, ['phase = "deg"', 'phase = "rad"']),
    "symbols over units": Export(sweep("f / Hz|x0 / um|F0 / N|delta / °", F, 1e3 * A, K * A, PHASE)),
    "milliseconds since 1970": Export(loop("timestamp|x (mm)|F (N)", [f"{1.79e12 + 1e3 * t:.0f}" for t in TIME], DISPLACEMENT, FORCE), "loop", (), {"units": {"time": "ms"}}),
    "milliseconds taken for seconds": Export(
        loop("timestamp|x (mm)|F (N)", [f"{1.79e12 + 1e3 * t:.0f}" for t in TIME], DISPLACEMENT, FORCE), None, ['time = "ms"'], {"units": {"time": "s"}}
    ),
    "columns of one width with a units row": Export("\n".join([
        "Frequency   Dyn Ampl   Dyn Stiff   Loss Angle", "     Hz       mm p-p     N/mm        deg",
        *(f"{f:10.3f} {2 * a:10.4f} {k:14.7f} {p:12.7f}" for f, a, k, p in zip(F, A, K, PHASE, strict=True)),
    ])),
    **INSTRUMENT_EXPORTS,
}  # fmt: skip
