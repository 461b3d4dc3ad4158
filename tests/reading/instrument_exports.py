"""Files of single instruments and languages, with symbols, units and notes that the reader has to understand."""

import numpy as np
from export_tables import (
    DAMPING,
    DISPLACEMENT,
    ETA,
    FORCE,
    LVM,
    MODULUS,
    NOISE,
    PHASE,
    STIFFNESS,
    TIME,
    USUAL,
    A,
    Export,
    F,
    G,
    K,
    blocks,
    loop,
    sweep,
    table,
)

INSTRUMENT_EXPORTS: dict[str, Export] = {
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
        sweep("Frequency [Hz]|Amplitude [mm]|K* [kN/mm]|Phase (rad)", F, A, K, PHASE), words=["is read in the stated unit N/mm, not in kN/mm of the header"],
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
    "volts without any force": Export(
        loop("t [s]|displacement [V]|force [V]", TIME, 10 * DISPLACEMENT, FORCE / 200), None, ["unknown unit", "0 N"],
        {"units": {"displacement": "0.1 mm", "force": "0 N"}},
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
        ["1 row that equals"],
    ),
    "means and deviations of parts": Export(
        sweep("Frekvens (Hz)|Amplitud (mm)|Styvhet medel (N/mm)|Styvhet std (N/mm)|Förlustfaktor medel|Förlustfaktor std", F, A, K, 0 * F + 20, ETA, 0 * F + 0.004)
    ),
    "a range that is peak to peak": Export(sweep("Frekvence [Hz]|Rozkmit síly [N]|Rozkmit [mm]|Ztrátový úhel [°]", F, 2 * A * K, 2 * A, PHASE)),
    **{
        f"a footnote:{note}": Export("| f / Hz | Amplitude¹ / mm | K′ / kN/mm | K″ / kN/mm |\n|--:|--:|--:|--:|\n" + "".join(
            f"| {f:g} | {factor * a:g} | {k.real / 1e3:.9f} | {k.imag / 1e3:.9f} |\n" for f, a, k in zip(F, A, STIFFNESS, strict=True)
        ) + f"\n¹{note}\n")
        for note, factor in ((" as set on the controller", 1), (" peak to peak, as set on the controller", 2))
    },
    "parts in a header of two levels": Export(
        "part,,P01,P01,P02,P02\nquantity,,Kdyn_N_per_mm,loss_angle_deg,Kdyn_N_per_mm,loss_angle_deg\n"
        + sweep("amplitude_mm|frequency_Hz||||", A, F, K, PHASE, K, PHASE, mark=",")
    ),
    "lines above the first block": Export(
        "2 bushings in parallel\n" + blocks("Amplitude: {} mm".format, "f [Hz]|K* [N/mm]|tan delta"), words=["line 1 is not understood"]
    ),
    "a force of noise": Export(
        loop("time [s]|displacement [mm]|force [N]", TIME, DISPLACEMENT, NOISE), "loop", ["the record is not a steady loop"], reference={"force": NOISE}
    ),
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
