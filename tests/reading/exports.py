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
            ("Amplitude [±mm]", 1.0), ("Amplitude (mm pk)", 1.0), ("Amplitude peak [mm]", 1.0), ("±Displacement [mm]", 1.0),
        )
    },
    "amplitudes stated as rms": Export(
        sweep("Frequency [Hz]|Amplitude [mm]|K* [N/mm]|tan delta", F, 0.5**0.5 * A, K, ETA), stated={"amplitude": "rms"}
    ),
    "damping": Export(sweep(USUAL + "Damping [-]", F, A, K, ETA), None, ["loss_factor", "damping_ratio"]),
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
    # instruments and languages
    "MTS EDS": Export(
        "MTS Elastomer\nSpecimen: BUSH-12\n\n" + sweep(
            "Target Frequency|Frequency|Dyn Disp Amp|Dyn Force Amp|Mean Disp|Mean Force|K*|K'|K''|Phase|Damping C|Energy",
            F, F, A, K * A, 0 * F + 0.1, 0 * F + 300, K, STIFFNESS.real, STIFFNESS.imag, PHASE, DAMPING, F, mark=",",
        ).replace("Energy\n", "Energy\nHz,Hz,mm,N,mm,N,N/mm,N/mm,N/mm,deg,N·s/mm,N·mm\n"), words=["by its unit"],
    ),
    "WaveMatrix": Export(
        loop("Total Time (s)|Step|Position(8800 (0,1):Position) (mm)|Load(8800 (0,1):Load) (kN)", TIME, ["1"] * 600, DISPLACEMENT, FORCE / 1e3), "loop"
    ),
    "NETZSCH": Export(
        "#INSTRUMENT:\tDMA 242E\n#SEPARATOR:\tSEMICOLON\n\n##Temp./°C;f/Hz;Strain ampl./%;E'/MPa;E''/MPa\n"
        + "\n".join(table([], 0 * F + 25, F, 10 * A, G.real, G.imag, mark=";")[1:]), reference=MODULUS,
    ),
    "TRIOS steps": Export(
        "Filename,x.tri\n" + "".join(
            f"\n[step]\nFrequency sweep - {n}\nAngular frequency,Step time,Oscillation strain,Storage modulus,Loss modulus\nrad/s,s,%,MPa,MPa\n"
            + "\n".join(table([], 2 * np.pi * F[s], F[s], 10 * A[s], G[s].real, G[s].imag, mark=",")[1:]) + "\n"
            for n, s in enumerate((slice(0, 5), slice(5, 10)), 1)
        ), reference=MODULUS,
    ),
    "RheoCompass in German and UTF-16": Export(
        (
            "Projekt:\tEPDM\n\nAbschnittsdaten:\tMesspkt.\tKreisfrequenz\tScherdeformation\tSpeichermodul\tVerlustmodul\n\t\t[rad/s]\t[%]\t[Pa]\t[Pa]\n"
            + "\n".join(table([], [""] * 10, F, 2 * np.pi * F, 10 * A, 1e6 * G.real, 1e6 * G.imag)[1:]).replace(".", ",")
        ).encode("utf-16"), reference=MODULUS,
    ),
    "catman": Export(
        "HBM catman\nKanäle: 3\n\nZeit  1 - Standardmessrate\tWeg_WA20\tKraft_U10M\n[s]\t[mm]\t[kN]\n"
        + "\n".join(table([], TIME, DISPLACEMENT, FORCE / 1e3)[1:]).replace(".", ","), "loop",
    ),
    "dSPACE": Export(
        "raster,HostService\npath,,Root/Disp,Root/Force\nname,Time,Disp,Force\nunit,s,mm,N\ntrace_values\n"
        + "\n".join(table([], [""] * 600, TIME, DISPLACEMENT, FORCE, mark=",")[1:]), "loop", ["trace_values"],
    ),
    "decibels": Export(sweep("f [Hz]|A [mm]|K* [dB re 1 N/mm]|Phase [deg]", F, A, 20 * np.log10(K), PHASE)),
    "decibels without a reference": Export(sweep("f [Hz]|A [mm]|K* [dB]|Phase [deg]", F, A, 20 * np.log10(K), PHASE), None, ["logarithms of the stiffness", '--unit "stiffness=N/mm"']),
    "decibels, as the hint says": Export(
        sweep("f [Hz]|A [mm]|K* [dB]|Phase [deg]", F, A, 20 * np.log10(K), PHASE), stated={"units": {"stiffness": "N/mm"}}
    ),
    "complex numbers": Export(sweep("f [Hz]|A [mm]|K* [N/mm]", F, A, [f"{k.real:.6f} + {k.imag:.6f}i" for k in STIFFNESS], mark=";")),
    "a compliance": Export(sweep("f [Hz]|A [mm]|J' [mm/N]|J'' [mm/N]", F, A, (1 / STIFFNESS).real, -(1 / STIFFNESS).imag)),
    "a decrement": Export(sweep(USUAL + "Log. decrement [-]", F, A, K, np.pi * ETA), None, ["by pi"]),
    "carets": Export(sweep(USUAL + "tan delta", F, A, K, ETA, mark="^")),
    "dynamic motion and force": Export(sweep("Freq./Hz|Weg dyn. SS/mm|Kraft dyn. SS/N|Verlustwinkel/Grad", F, 2 * A, 2 * K * A, PHASE, mark=";").replace("Freq.", "Freq").replace("dyn.", "dyn")),
    "real and imaginary by words": Export(sweep("Freq [Hz]|Amp [mm]|Dyn Stiff Real [N/mm]|Dyn Stiff Imag [N/mm]", F, A, STIFFNESS.real, STIFFNESS.imag), words=["by its unit"]),
    "wide table, levels without decimals": Export(
        "".join(
            f"{title}\nFrequenz [Hz];0.1 mm;0.5 mm;1 mm\n" + "".join(f"{f:g};{v[n]:.9g};{v[5 + n]:.9g};{v[5 + n]:.9g}\n" for n, f in enumerate(F[:5])) + "\n"
            for title, v in (("Dynamische Steifigkeit [N/mm]", K), ("Verlustwinkel [°]", PHASE))
        ).replace(".", ","),
        reference={name: np.concatenate([v, v[5:]]) for name, v in (("frequency", F), ("stiffness", 1e3 * STIFFNESS))} | {"amplitude": 1e-3 * np.repeat([0.1, 0.5, 1.0], 5)},
    ),
    "an overflow and means": Export(
        sweep(USUAL + "tan delta", F, A, K, ETA, mark=";") + "90;0.1;OVR;0.1\nDurchschnitt;0.3;1400;0.1\nx;0.1;20;0.1\n", words=["3 rows left out"]
    ),
    "header cells with line ends": Export('"Frequency\n(Hz)","Amplitude\n(mm)","K*\n(N/mm)","Phase\n(deg)"\n' + "\n".join(table([], F, A, K, PHASE, mark=",")[1:])),
    **{
        f"encoding {encoding}": Export(sweep(header, F, A, K, last, mark=";").encode(encoding))
        for encoding, header, last in (
            ("cp932", "周波数[Hz]|振幅[mm]|動ばね定数[N/mm]|損失係数", ETA), ("gb18030", "频率(Hz)|振幅(mm)|动刚度(N/mm)|损耗角(°)", PHASE),
            ("cp1250", "Częstotliwość [Hz]|Amplituda [mm]|Sztywność dynamiczna [N/mm]|Kąt strat [°]", PHASE),
            ("cp1254", "Frekans [Hz]|Genlik [mm]|Dinamik rijitlik [N/mm]|Kayıp faktörü", ETA), ("cp1251", "Частота, Гц|Амплитуда, мм|Жёсткость, Н/мм|Угол потерь, град", PHASE), ("cp1252", "Fréquence [Hz]|Amplitude crête [mm]|Raideur [N/mm]|Facteur de perte", ETA),
        )
    },
    "JIS K 6394": Export(
        "試験名,防振ゴム動特性\n試験日,2026/05/03\n温度,23℃\n\n" + sweep("周波数(Hz)|片振幅(mm)|動的ばね定数(N/mm)|損失係数(-)", F, A, K, ETA, mark=",")
    ),
    "GB/T": Export("试样编号,3\n试验温度,23℃\n" + sweep("频率/Hz|双振幅/mm|动刚度/(kN/mm)|相位角/rad", F, 2 * A, K / 1e3, PHASE * np.pi / 180, mark=",")),
    "means of levels": Export(
        sweep("f [Hz]|A0 [mm]|K* [N/mm]|delta [°]|Status", [*F[:5], "MW", *F[5:], "MW"], [*A[:5], "", *A[5:], ""], [*K[:5], 2.5, *K[5:], 2.5], [*PHASE[:5], 2.5, *PHASE[5:], 2.5], ["OK"] * 12),
        words=["2 rows left out"],
    ),
    # symbols, units and names that colleagues wrote without knowing the reader
    **{
        f"the symbol decides: {header}": Export(sweep(f"f [Hz]|A [mm]|{header} [kN/mm]|tan delta", F, A, values / 1e3, ETA))
        for header, values in (
            ("Rigidezza elastica K'", STIFFNESS.real), ("Steifigkeit K'", STIFFNESS.real), ("Kd'", STIFFNESS.real), ("K1", STIFFNESS.real),
            ("Rigidez dinámica K*", K),
        )
    },
    "the symbols decide, of a loss": Export(sweep("f [Hz]|A [mm]|Rigidità K* [N/mm]|Rigidità K'' [N/mm]", F, A, K, STIFFNESS.imag)),
    **{
        f"multiples: {header}": Export(sweep(f"Pulsación (rad/s)|{header}|tan delta (x 10^-3)", 2 * np.pi * F, A * xs, K * ks, 1e3 * ETA))
        for header, xs, ks in (
            ("Amp [mm]|K* [10^5 N/m]", 1, 1e-2), ("Amp (1/100 mm)|K* (x1000 N/m)", 100, 1), ("Amp [10⁻² mm]|K* [E5 N/m]", 100, 1e-2),
            ("Amp [x 0.01 mm]|K* [N/mm]", 100, 1),
        )
    },
    **{
        f"a reference behind: {unit}": Export(sweep(f"f in Hz|Amplitude 0-p in mm|Kdyn{unit}|Phase in Grad", F, A, 20 * np.log10(1e3 * K), PHASE))
        for unit in (" in dB (re 1 N/m)", " [dB] re 1 N/m", "/dB re. 1 N/m")
    },
    "DSA": Export(sweep("Freq. (Hz)|DSA (%)|G' (MPa)|tan δ", F, 20 * A, G.real, ETA), reference=MODULUS),
    "s over its unit": Export(loop("t / s|s / µm|F / kN", TIME, 1e3 * DISPLACEMENT, FORCE / 1e3, mark=";"), "loop"),
    "s over its unit, named": Export(loop("t / s|s / µm|F / kN", TIME, 1e3 * DISPLACEMENT, FORCE / 1e3), "loop", (), {"columns": {"displacement": "s / µm"}}),
    "LabVIEW, unnamed channels and words for units": Export(
        LVM.replace("\tmm\tN\t", "\tmillimeters\tNewtons\t").replace("LVDT\tLoad Cell", "Untitled\tUntitled 1"), "loop", name="loop.lvm"
    ),
    "LabVIEW, an unnamed channel named": Export(
        LVM.replace("\tmm\tN\t", "\tmillimeters\tNewtons\t").replace("LVDT\tLoad Cell", "Untitled\tUntitled 1"), "loop", (),
        {"columns": {"displacement": "Untitled"}}, "loop.lvm",
    ),
    **{
        f"a second motion: {first}, {second}": Export(
            loop(f"time [s]|{first} [mm]|{second} [um]|force [N]", TIME, DISPLACEMENT, 1e3 * factor * DISPLACEMENT, FORCE), kind, words
        )
        for first, second, factor, kind, words in (
            ("Crosshead travel", "Extensometer", 0.8, None, ["more than one column", "Crosshead travel [mm]", "Extensometer [um]"]),
            ("Weg Traverse", "Feinmesser", 0.9, None, ["more than one column", "Feinmesser [um]"]),
            ("Stroke", "LVDT", 1.01, "loop", []), ("Stroke", "command", 1.2, "loop", []),
        )
    },
    "a second motion, chosen": Export(
        loop("time [s]|Stroke [mm]|LVDT [mm]|force [N]", TIME, 1.2 * DISPLACEMENT, DISPLACEMENT, FORCE), "loop", (), {"columns": {"displacement": "LVDT [mm]"}}
    ),
    **{
        f"counted above: {line}": Export(f"{line}\n" + sweep("Freq. Hz|Ampl. mm|Kd N/mm|δ deg", F, factor * A, K, PHASE))
        for line, factor in (
            ("Dyn. test: stroke given as total amplitude (pk-pk)", 2), ("All amplitudes pk-pk", 2), ("Amplituden sind Schwingbreiten", 2),
            ("Displacement amplitudes: rms", 0.5**0.5), ("Force: pk-pk", 1),
        )
    },
    **{
        f"an amplitude above: {line}": Export(
            f"{line}\n" + sweep("f [Hz]|K* [N/mm]|tan delta", F[:5], K[:5], ETA[:5]), reference={"frequency": F[:5], "amplitude": 1e-3 * A[:5], "stiffness": 1e3 * STIFFNESS[:5]}
        )
        for line in ("Amplitude: 0.2 mm peak-to-peak", "Dyn Amp  0.2 mm p-p", "Excitation: 0.07071068 mm rms", "Schwingbreite: 0,2 mm", "Excitation level 0.1 mm")
    },
    "a wide table with a mean and a stepped name above": Export(
        "Frequency / Hz;K' / kN/mm;;;;K'' / kN/mm;;\n;0.2 mm pp;1 mm pp;Mittel;;0.2 mm pp;1 mm pp\n"
        + "".join(
            f"{f:g};{a.real / 1e3:.9f};{b.real / 1e3:.9f};1;;{a.imag / 1e3:.9f};{b.imag / 1e3:.9f}\n"
            for f, a, b in zip(F[:5], STIFFNESS[:5], STIFFNESS[5:], strict=True)
        ),
        words=["Mittel"],
    ),
    "padded, below a numbered title": Export(
        ";;;;;\n;Messung 12;;;;\n;f;Amp;K;eta;\n;Hz;mm;N/mm;-;\n" + "".join(f";{f:g};{a:g};{k:.9g};{eta:.9g};\n" for f, a, k, eta in zip(F, A, K, ETA, strict=True))
    ),
    "units in brackets below wide gaps": Export("\n".join([
        "Freq      Amp pk-pk   K'          C               K*", "(Hz)      (mm)        (kN/m)      (kN-s/m)        (kN/m)",
        *(f"{f:<10.1f}{2 * a:<12.4f}{k.real:<12.6f}{c:<16.9f}{abs(k):<12.6f}" for f, a, k, c in zip(F, A, STIFFNESS, DAMPING, strict=True)),
    ])),
    "blocks of fixed width, a ratio without a unit": Export("\n".join(
        line for n in (slice(5), slice(5, None)) for line in [
            "   Frequency  Dyn Disp p-p          K*  Tan Delta     Energy", "          Hz            mm        N/mm                  N-mm",
            *(f"{f:12.3f}{2 * a:14.5f}{k:14.7f}{eta:12.8f}{1:9.3f}" for f, a, k, eta in zip(F[n], A[n], K[n], ETA[n], strict=True)),
            "        Mean       0.50000",
        ]
    ), words=["2 rows left out"]),
    **{
        f"a time in {unit} beside its rate": Export("Messrate: 20 Hz\n" + loop("Zeit|Weg [mm]|Kraft [N]", TIME / factor, DISPLACEMENT, FORCE), "loop")
        for unit, factor in (("s", 1.0), ("ms", 1e-3), ("min", 60.0))
    },
    "a time without unit beside another rate": Export("Messrate: 30 Hz\n" + loop("Zeit|Weg [mm]|Kraft [N]"), None, ['time = "s"', 'time = "ms"']),
    "a period": Export(sweep("Periodendauer [ms]|A [mm]|K* [N/mm]|tan delta", 1e3 / F, A, K, ETA), None, ["reciprocal of the period"]),
    "kilograms of force": Export(loop("t [s]|x [mm]|Load [kg]", TIME, DISPLACEMENT, FORCE / 9.80665), None, ['"kgf"']),
    "a double amplitude above": Export(
        "Amplitude 0.2 mm (double amplitude)\n" + sweep("f [Hz]|K* [N/mm]|tan delta", F[:5], K[:5], ETA[:5]),
        reference={"frequency": F[:5], "amplitude": 1e-3 * A[:5], "stiffness": 1e3 * STIFFNESS[:5]},
    ),
    "a complex compliance": Export(
        sweep("f [Hz]|A [mm]|Compliance real [mm/kN]|Compliance imag [mm/kN]", F, A, 1e3 * (1 / STIFFNESS).real, 1e3 * (1 / STIFFNESS).imag),
        words=["opposite sign"],
    ),
    "a receptance": Export(sweep("f [Hz]|A [mm]|Receptance x/F [mm/kN]|Phase x/F [deg]", F, A, 1e3 / K, -PHASE), words=["opposite sign"]),
    "an acceleration": Export(
        sweep("f [Hz]|Accel amplitude (g pk)|Force amplitude (N pk)|Phase (deg)", F, 1e-3 * A * (2 * np.pi * F) ** 2 / 9.80665, A * K, PHASE - 180),
        words=["is an acceleration"],
    ),
    # a wrong unit in a header, numbers in volts or digits, marks for missing values
    "a wrong unit in a header": Export(
        sweep("Frequency [Hz]|Amplitude [mm]|K* [kN/mm]|Phase (rad)", F, A, K, PHASE), words=["is read in N/mm, as stated, and not in kN/mm"],
        stated={"units": {"stiffness": "N/mm", "phase": "deg"}},
    ),
    "a phase whose unit cannot be": Export(sweep("Frequency [Hz]|Amplitude [mm]|K* [kN/mm]|Phase (rad)", F, A, K, PHASE), None, ['--unit "phase=deg"']),
    "a stiffness that no rig can move": Export(
        sweep("f [Hz]|A [mm]|K* [kN/mm]|tan delta", F, A, K, ETA), words=["force amplitude", "is the unit in the header right?"],
        reference={"stiffness": 1e6 * STIFFNESS},
    ),
    "volts": Export("1 V = 0.1 mm\n1 V = 200 N\n" + loop("t [s]|displacement [V]|force [V]", TIME, 10 * DISPLACEMENT, FORCE / 200), None, ['"displacement=0.1 mm"']),
    "volts, as the hint says": Export(
        "1 V = 0.1 mm\n1 V = 200 N\n" + loop("t [s]|displacement [V]|force [V]", TIME, 10 * DISPLACEMENT, FORCE / 200), "loop", (),
        {"units": {"displacement": "0.1 mm", "force": "200 N"}},
    ),
    "digits": Export(
        "Kanal 2 Weg 1 digit = 0,0005 mm\n" + loop("t [s]|Kanal 1 [N]|Kanal 2", TIME, FORCE, 2000 * DISPLACEMENT), None, ['"displacement=0.0005 mm"'],
        {"columns": {"displacement": "Kanal 2"}},
    ),
    "a speed above": Export("Crosshead speed: 12,5 mm/min\n" + loop("displacement [mm]|force [N]", DISPLACEMENT, FORCE), None, ['rate = "12.5 mm/min"']),
    **{
        f"a loop with {mark} for missing values": Export(
            loop("time [s]|displacement [mm]|force [N]", *np.insert([TIME, DISPLACEMENT, FORCE], 7, [[0.325, 0.2, float(mark)]], axis=1)), "loop", ["1 row left out"]
        )
        for mark in ("-9999", "99999")
    },
    **{
        f"a sweep with {mark} for missing values": Export(
            sweep(USUAL + "tan delta", *np.insert([F, A, K, ETA], 7, [[15, 0.5, k, eta]], axis=1)), words=["1 row left out"]
        )
        for mark, k, eta in (("9999", 9999, 9999), ("-1", 1400, -1))
    },
    "large values are no marks": Export(
        sweep("f [Hz]|A [mm]|K* [N/mm]|tan delta", F, A, K * 999.0 / K.max(), ETA), reference={"stiffness": 999e3 * STIFFNESS / K.max()}
    ),
    # remarks that change the meaning, and names in the languages of laboratories
    **{
        f"remark: {line}": Export(f"{line}\n" + loop(), "loop", [f'line 1 is not understood: "{line}"'])
        for line in ("2 bushings in parallel", "Zwei Buchsen parallel geprüft", "group delay 6.7 ms, NOT compensated", "cycles 1-2 are conditioning")
    },
    "marked rows": Export(sweep(USUAL + "tan delta|Note", F, A, K, ETA, ["conditioning"] * 2 + ["ok"] * 8), words=['2 rows are marked "conditioning"']),
    "texts below the units": Export(
        "Zeit  1 - Messrate\tCH 1 Kraft U10\tCH 2 Weg WA20\ns\tkN\tmm\nRate 100 Hz\tBE 10 Hz\tBE 10 Hz\n"
        + "\n".join(table([], TIME, FORCE / 1e3, DISPLACEMENT)[1:]), "loop", ["BE 10 Hz"],
    ),
    "a time without a name": Export("path,,Disp/Out1,Force/Out1\nunit,s,mm,N\n" + "\n".join(table([], [""] * 600, TIME, DISPLACEMENT, FORCE, mark=",")[1:]), "loop", ["column 2"]),
    "wf_increment": Export("wf_increment = 5.0E-2\n" + loop("Displacement|Force", DISPLACEMENT, FORCE).replace("\n", "\nmm\tN\n", 1), "loop", ["20 a second"]),
    "a channel in brackets": Export(loop("Total Time (s)|Position(8800MT (0,1):Position) (mm)|Load(8800MT (0,1):Load) (kN)", TIME, DISPLACEMENT, FORCE / 1e3), "loop"),
    "a static curve": Export(
        loop("time [s]|displacement [mm]|force [N]", TIME[:200], 1 - np.cos(np.pi * TIME[:200] / 5), 800 * (1 - np.cos(np.pi * TIME[:200] / 5 + 0.1))),
        "loop", ["one loading and unloading"],
        reference={"displacement": 1e-3 * (1 - np.cos(np.pi * TIME[:200] / 5))},
    ),
    "rows that repeat": Export(
        loop("time [s]|displacement [mm]|force [N]", *np.repeat([TIME, DISPLACEMENT, FORCE], [1 + (n == 200) for n in range(600)], axis=1)), "loop",
        ["1 row that repeats"],
    ),
    "means and deviations of parts": Export(
        sweep("Frekvens (Hz)|Amplitud (mm)|Styvhet medel (N/mm)|Styvhet std (N/mm)|Förlustfaktor medel|Förlustfaktor std", F, A, K, 0 * F + 20, ETA, 0 * F + 0.004)
    ),
    "a range that is peak to peak": Export(sweep("Frekvence [Hz]|Rozkmit síly [N]|Rozkmit [mm]|Ztrátový úhel [°]", F, 2 * A * K, 2 * A, PHASE)),
    "a footnote": Export("| f / Hz | Amplitude¹ / mm | K′ / kN/mm | K″ / kN/mm |\n|--:|--:|--:|--:|\n" + "".join(
        f"| {f:g} | {a:g} | {k.real / 1e3:.9f} | {k.imag / 1e3:.9f} |\n" for f, a, k in zip(F, A, STIFFNESS, strict=True)
    )),
    "a row for each quantity": Export("".join(
        f"Amplituda drgań (0–szczyt);{a};mm\n" + "".join(
            f"{name};{';'.join(f'{value:.9g}' for value in values[a == A])}\n"
            for name, values in (("Częstotliwość [Hz]", F), ("Sztywność dynamiczna |K*| [kN/mm]", K / 1e3), ("Kąt stratności [°]", PHASE))
        )
        for a in (0.1, 0.5)
    ).replace(".", ",")),
    "the number of a column below two header rows": Export(
        sweep("f [Hz]|A [mm]|K* [N/mm]|delta [°]|K* [N/mm]|delta [°]", F, A, K, PHASE, 2 * K, PHASE), stated={"columns": {"stiffness": "3", "phase": "4"}}
    ),
    **{
        f"no time below {line}": Export(f"{line}\n" + loop("displacement [mm]|force [N]", DISPLACEMENT, FORCE), kind, words)
        for line, kind, words in (
            *((line, "loop", ["20 a second"]) for line in (
                "Sampling rate: 20 Hz", "Abtastrate\t0,02\tkHz", "# fs = 20", "Sample interval [ms] 50", "dt = 0.05 s",
                "Sample rate: 20.000 samples/s", "Data rate\t1200\t1/min",
            )),
            *((line, None, ['sampling_rate = "100 Hz"']) for line in ("Sampling rate: 1,000 Hz", "dt = 0.05", "Rate: 20 Hz")),
        )
    },
    "no time, but its sampling rate stated": Export(
        loop("displacement [mm]|force [N]", DISPLACEMENT, FORCE), "loop", (), {"sampling_rate": "20 Hz"}
    ),
    "times too coarse": Export(loop("Time [s]|Displacement [mm]|Force [N]", ["0"] * 300 + ["1"] * 300, DISPLACEMENT, FORCE), None, ["more digits"]),
}  # fmt: skip
