"""The words that columns go by in test files: English, German, French, Spanish and Chinese ones, and symbols.

Case, accents, blanks, hyphens and underscores do not count, and an umlaut is the same as its vowel with or without e.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bushfit.geometry import STRAINING, Motion

#: For each column of a loop, the headers it goes by.
LOOP_COLUMNS = {
    "time": (
        *("time", "t", "zeit", "temps", "tiempo", "时间", "elapsed time", "running time", "test time", "total time"),
        *("Prüfzeit", "Messzeit"),
    ),
    "displacement": (
        *("displacement", "disp", "deflection", "stroke", "travel", "position", "extension"),
        *("rotation", "angle", "twist", "phi"),
        *("Weg", "Verschiebung", "Auslenkung", "Hub", "Federweg", "Prüfweg", "Kolbenweg", "Winkel", "Drehwinkel"),
        *("Verdrehung", "Verdrehwinkel", "Standardweg", "Traversenweg", "Axialweg", "Radialweg", "Verformung"),
        *("crosshead", "course standard", "traverse"),
        *("déplacement", "course", "flèche", "enfoncement", "rotation", "angle de torsion", "rotación"),
        *("desplazamiento", "recorrido", "carrera", "deformación", "ángulo", "giro", "ángulo de giro"),
        *("位移", "行程", "角度", "转角"),
    ),
    "force": (
        *("force", "load", "torque", "moment", "F"),
        *("Kraft", "Prüfkraft", "Standardkraft", "Axialkraft", "Radialkraft", "Last", "Drehmoment", "Torsionsmoment"),
        *("effort", "charge", "force standard", "couple", "moment de torsion"),
        *("fuerza", "carga", "par", "momento", "par de torsión"),
        *("力", "载荷", "负荷", "扭矩"),
    ),
}
#: For each column of a sweep, the headers it goes by.
SWEEP_COLUMNS = {
    "frequency": (
        *("frequency", "freq", "f", "angular frequency", "ang frequency", "omega", "ω", "test frequency"),
        *("Frequenz", "Prüffrequenz", "Kreisfrequenz", "fréquence", "pulsation", "frecuencia", "频率", "角频率"),
    ),
    "amplitude": (
        *("amplitude", "ampl", "amp", "displacement amplitude", "rotation amplitude", "angle amplitude"),
        *("dynamic amplitude", "dynamic displacement amplitude", "dyn amplitude", "deflection amplitude"),
        *("A", "x0", "s0", "stroke amplitude", "travel amplitude", "Prüfamplitude", "dynamische Amplitude"),
        *("peak amplitude", "amplitude crête", "dyn Wegamplitude", "Wegamplitude", "Winkelamplitude"),
        *("amplitude de déplacement", "amplitude dynamique"),
        *("amplitud", "amplitud de desplazamiento", "amplitud dinámica", "振幅", "幅值"),
    ),
    "amplitude_reached": ("amplitude reached", "erreichte Amplitude", "amplitude atteinte", "amplitud alcanzada"),
    "stiffness": (
        *("stiffness", "dynamic stiffness", "stiffness magnitude", "complex stiffness", "kdyn", "cdyn", "|k|", "K*"),
        *("Steifigkeit", "dynamische Steifigkeit", "Federsteifigkeit", "Drehsteifigkeit", "dyn Steifigkeit"),
        *("Federrate", "dynamische Federrate", "dyn Federrate", "Federkonstante", "|K*|", "c*", "K"),
        *("Steifigkeit dyn", "Steifigkeit dynamisch", "dyn Federsteifigkeit", "dynamische Federsteifigkeit"),
        *("dyn stiffness", "stiffness dyn", "K abs", "dynamic spring rate", "dynamic rate", "raideur complexe"),
        *("komplexe Steifigkeit", "Betrag der Steifigkeit", "rigidez compleja"),
        *("raideur", "rigidité", "raideur dynamique", "rigidité dynamique"),
        *("rigidez", "rigidez dinámica", "刚度", "动刚度"),
    ),
    "loss_factor": (
        *("loss factor", "tan delta", "tan d", "eta", "η", "tan δ", "damping factor", "damping"),
        *("Verlustfaktor", "Dämpfung tan d", "Dämpfung tan delta"),
        *("facteur de perte", "facteur de pertes", "facteur d'amortissement"),
        *("factor de pérdida", "factor de pérdidas", "损耗因子"),
    ),
    "phase": (
        *("phase", "phase angle", "loss angle", "delta", "δ", "phi"),
        *("Phasenwinkel", "Verlustwinkel", "Phasenverschiebung", "Dämpfungswinkel", "Verlustwinkel δ"),
        *("déphasage", "angle de phase", "angle de perte", "angle de pertes"),
        *("fase", "ángulo de fase", "ángulo de pérdida", "ángulo de pérdidas", "desfase", "相位", "相位角", "损耗角"),
    ),
    "storage_stiffness": (
        *("storage stiffness", "k'", "elastic stiffness"),
        *("Speichersteifigkeit", "raideur de stockage", "raideur élastique", "raideur conservative"),
        *("rigidité de stockage", "rigidez de almacenamiento", "rigidez elástica", "储能刚度"),
    ),
    "loss_stiffness": (
        *("loss stiffness", "k''", "Verluststeifigkeit", "raideur de perte", "raideur de pertes"),
        *("raideur dissipative", "rigidité de perte", "rigidité de pertes"),
        *("rigidez de pérdida", "rigidez de pérdidas", "损耗刚度"),
    ),
    "temperature": (
        *("temperature", "temp", "T", "sample temperature", "specimen temperature", "test temperature"),
        *("Temperatur", "Prüftemperatur", "Probentemperatur", "température", "température d'essai"),
        *("temperatura", "temperatura de ensayo", "ϑ", "温度", "试验温度"),
    ),
    "relative_error": (
        *("relative error", "rel error", "relative standard deviation", "relative uncertainty", "relativer Fehler"),
        *("rel Fehler", "relative Standardabweichung", "relative Unsicherheit", "erreur relative"),
        *("incertitude relative", "error relativo", "incertidumbre relativa", "相对误差"),
    ),
    "repeat": ("repeat", "repetition", "Wiederholung", "Wdh", "Messung", "repetición", "重复"),
}  # fmt: skip


def _said(bodies: str, words: str) -> tuple[str, ...]:
    """Every word, such as "acceleration", before and after every body, such as "base"; words and bodies part at |."""
    return tuple(
        way for body in bodies.split("|") for word in words.split("|") for way in (f"{body} {word}", word + body)
    )


#: Names of the base of a mount on a shaker.
_BASE = (
    "base|input|table|shaker|drive|excitation|control|Basis|Fußpunkt|Tisch|Anregung|Eingang|Anregungs|Fußpunkts"
    "|de la base|d'entrée|entrée|de la table|d'excitation|excitation"
)
#: Names of the mass on it.
_MASS = "mass|output|response|top|Masse|Massen|Antwort|Ausgang|de la masse|masse|de réponse|réponse|de sortie|sortie"
_ACCELERATION = "acceleration|accel|acc|Beschleunigung|Beschl"
_PHASE = "phase|phase angle|Phasenwinkel|déphasage"
#: For each column of a resonance test (a mass on a mount on a shaker), the headers it goes by.
RESONANCE_COLUMNS = {
    "frequency": SWEEP_COLUMNS["frequency"],
    "base_acceleration": _said(_BASE, _ACCELERATION),
    "mass_acceleration": _said(_MASS, _ACCELERATION),
    "base_phase": _said(_BASE, _PHASE),
    "mass_phase": _said(_MASS, _PHASE),
    "phase": (
        *("phase", "phase angle", "phase difference", "relative phase", "transmissibility phase", "phase of T", "phi"),
        *("Phasenwinkel", "Phasendifferenz", "Phasenverschiebung", "Phase Transmissibilität", "Phase Übertragung"),
        *("déphasage", "angle de phase", "phase transmissibilité", "phase de la transmissibilité"),
    ),
    "transmissibility": (
        *("transmissibility", "transmissibility magnitude", "transmissibility amplitude", "|T|", "transmission ratio"),
        *("Transmissibilität", "Übertragungsfaktor", "Vergrößerungsfaktor", "Betrag Transmissibilität"),
        *("transmissibilité", "module de la transmissibilité", "facteur de transmission"),
    ),
    "transmissibility_real": (
        *("transmissibility real", "real transmissibility", "Re T", "real part of T", "Realteil T"),
        *("Realteil Transmissibilität", "partie réelle transmissibilité"),
    ),
    "transmissibility_imaginary": (
        *("transmissibility imaginary", "transmissibility imag", "imaginary transmissibility", "Im T"),
        *("imaginary part of T", "Imaginärteil T", "Imaginärteil Transmissibilität"),
        "partie imaginaire transmissibilité",
    ),
    **{
        f"{role}_{part}": tuple(f"{name} {word}" for name in _said(bodies, _ACCELERATION) for word in words)
        for role, bodies in (("base", _BASE), ("mass", _MASS))
        for part, words in (
            ("real", ("real", "re", "Realteil", "réel", "partie réelle")),
            ("imaginary", ("imaginary", "imag", "im", "Imaginärteil", "imaginaire", "partie imaginaire")),
        )
    },
}  # fmt: skip
#: Names of a strain.
_STRAINS = (
    *("strain", "shear strain", "engineering strain", "tensile strain", "compressive strain", "deformation"),
    *("Dehnung", "Scherung", "Scherdehnung", "Verzerrung", "Schubverzerrung", "Gleitung", "Stauchung", "Verformung"),
    *("cisaillement", "glissement", "deformación", "cizalladura", "应变", "剪应变", "剪切应变"),
    *("gamma", "epsilon", "\u03b3", "\u03b5"),
)
#: For each column of a test of strain and modulus, the headers it goes by in place of those above.
_STRAINING = {
    "displacement": _STRAINS,
    "force": (
        *("stress", "shear stress", "engineering stress", "tensile stress", "compressive stress", "tau", "sigma"),
        *("Spannung", "Schubspannung", "Scherspannung", "contrainte", "contrainte de cisaillement", "\u03c4", "\u03c3"),
        *("esfuerzo", "esfuerzo cortante", "tensión", "tensión cortante", "应力", "剪应力", "剪切应力"),
    ),
    "amplitude": (
        *SWEEP_COLUMNS["amplitude"],
        *(f"{before}{strain}{after}"
          for strain in _STRAINS
          for before, after in (("", ""), ("", " amplitude"), ("", "samplitude"), ("", " dyn"), ("dyn ", ""),
                                ("dynamic ", ""), ("dynamische ", ""), ("amplitude de ", ""), ("amplitud de ", ""))),
        *("oscillation strain", "oscillatory strain", "complex shear strain", "complex strain", "gamma0"),
        *("Scheramplitude", "Deformationsamplitude", "déformation dynamique", "deformación dinámica", "应变幅值"),
    ),
    "stiffness": (
        *("complex modulus", "dynamic modulus", "complex shear modulus", "dynamic shear modulus", "modulus"),
        *("|G*|", "|E*|", "G*", "E*", "|G|", "|E|", "G abs", "E abs", "shear modulus complex component"),
        *("komplexer Modul", "komplexer Schubmodul", "dynamischer Modul", "dynamischer Schubmodul", "Schubmodul"),
        *("module complexe", "module dynamique", "module de cisaillement", "módulo complejo", "módulo dinámico"),
        *("复数模量", "复合模量", "动态模量"),
    ),
    "storage_stiffness": (
        *("storage modulus", "shear storage modulus", "elastic modulus", "G'", "E'", "G storage", "E storage"),
        *("G stor", "E stor", "Speichermodul", "Speicherschubmodul", "Schubspeichermodul", "module de conservation"),
        *("module de stockage", "module élastique", "módulo de almacenamiento", "módulo elástico", "储能模量"),
        *("shear modulus elastic component", "modulus'"),
    ),
    "loss_stiffness": (
        *("loss modulus", "shear loss modulus", "viscous modulus", "G''", "E''", "G loss", "E loss", "Verlustmodul"),
        *("Verlustschubmodul", "Schubverlustmodul", "module de perte", "module de pertes", "module visqueux"),
        *("módulo de pérdida", "módulo de pérdidas", "módulo viscoso", "损耗模量", "损失模量"),
        *("shear modulus viscous component", "modulus''"),
    ),
}  # fmt: skip
#: The columns of which the headers depend on the motion: those of what moves and of what resists it.
OF_MOTION = (*_STRAINING, "amplitude_reached")


def of_motion(names: Mapping[str, Sequence[str]], motion: Motion) -> dict[str, Sequence[str]]:
    """The headers that columns go by in a test of one kind of motion: G' names a modulus, and no stiffness."""
    return {role: _STRAINING.get(role, usual) if motion is STRAINING else usual for role, usual in names.items()}
