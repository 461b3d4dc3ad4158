"""The headers that columns go by in test files: English, German, French, Spanish and Chinese words, and symbols.

Case, accents, blanks, hyphens and underscores do not count, and an umlaut is the same as its vowel with or without e.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from bushfit import units

#: How an amplitude is counted.
AmplitudeConvention = Literal["zero-to-peak", "peak-to-peak"]

#: For each column of a loop, the headers it goes by.
LOOP_COLUMNS = {
    "time": ("time", "t", "zeit", "temps", "tiempo", "时间", "elapsed time", "running time", "test time", "Prüfzeit"),
    "displacement": (
        *("displacement", "disp", "deflection", "stroke", "travel", "position", "extension"),
        *("rotation", "angle", "twist", "phi"),
        *("Weg", "Verschiebung", "Auslenkung", "Hub", "Federweg", "Prüfweg", "Kolbenweg", "Winkel", "Drehwinkel"),
        *("Verdrehung", "Verdrehwinkel", "Standardweg", "Traversenweg", "Axialweg", "Radialweg", "Verformung"),
        *("déplacement", "course", "flèche", "enfoncement", "rotation", "angle de torsion", "rotación"),
        *("desplazamiento", "recorrido", "carrera", "deformación", "ángulo", "giro", "ángulo de giro"),
        *("位移", "行程", "角度", "转角"),
    ),
    "force": (
        *("force", "load", "torque", "moment", "F"),
        *("Kraft", "Prüfkraft", "Standardkraft", "Axialkraft", "Radialkraft", "Last", "Drehmoment", "Torsionsmoment"),
        *("effort", "charge", "couple", "moment de torsion"),
        *("fuerza", "carga", "par", "momento", "par de torsión"),
        *("力", "载荷", "负荷", "扭矩"),
    ),
}
#: For each column of a sweep, the headers it goes by.
SWEEP_COLUMNS = {
    "frequency": ("frequency", "freq", "f", "Frequenz", "Prüffrequenz", "fréquence", "frecuencia", "频率"),
    "amplitude": (
        *("amplitude", "ampl", "amp", "displacement amplitude", "rotation amplitude", "angle amplitude"),
        *("dynamic amplitude", "Wegamplitude", "Winkelamplitude", "amplitude de déplacement", "amplitude dynamique"),
        *("amplitud", "amplitud de desplazamiento", "amplitud dinámica", "振幅", "幅值"),
    ),
    "amplitude_reached": ("amplitude reached", "erreichte Amplitude", "amplitude atteinte", "amplitud alcanzada"),
    "stiffness": (
        *("stiffness", "dynamic stiffness", "stiffness magnitude", "complex stiffness", "kdyn", "cdyn", "|k|", "K*"),
        *("Steifigkeit", "dynamische Steifigkeit", "Federsteifigkeit", "Drehsteifigkeit", "dyn Steifigkeit"),
        *("Federrate", "dynamische Federrate", "dyn Federrate", "dyn. Federrate", "Federkonstante", "|K*|", "c*"),
        *("Steifigkeit dyn", "Steifigkeit dynamisch", "dyn Federsteifigkeit", "dynamische Federsteifigkeit"),
        *("dyn stiffness", "stiffness dyn"),
        *("raideur", "rigidité", "raideur dynamique", "rigidité dynamique"),
        *("rigidez", "rigidez dinámica", "刚度", "动刚度"),
    ),
    "loss_factor": (
        *("loss factor", "tan delta", "tandelta", "tan d", "eta", "η", "tan δ"),
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
    "repeat": (
        *("repeat", "repetition", "Wiederholung", "Wdh", "Messung", "répétition", "repetición", "重复"),
    ),
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
_ACCELERATION = "acceleration|accel|acc|Beschleunigung|Beschl|accélération"
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
        *("partie imaginaire transmissibilité",),
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
#: Words that tell where or how a channel was recorded, but not what it is.
_ASIDES = re.compile(r"\b(?:axial|radial|torsional|measured|actual|gemessen|mesure|medido|ist)\b")
#: For the roles that the symbol f may stand for, units by which it stands for the other one.
_UNITS_NOT_F = {"force": ("Hz",), "frequency": ("N", "N m")}
#: Names of an amplitude that count it peak-to-peak by themselves. "range" alone and "Schwingungsweite" are not among
#: them, because some call the amplitude so.
_PEAK_TO_PEAK_NAMES = {
    *("doppelamplitude", "schwingbreite", "schwingungsbreite", "schwingweite", "doppelhub", "2a", "2amplitude"),
    *("doubleamplitude", "totalamplitude", "fullamplitude", "doublestroke", "displacementrange", "rotationrange"),
    *("amplitudedouble", "amplitudetotale", "amplituddoble", "dobleamplitud", "amplitudtotal"),
    *("2xamplitude", "2xa", "峰峰值"),
}
#: The word "peak".
_PEAK = r"(?:peak|pk|spitze|crete|cresta|pico|pic)"
#: Where a word begins; an underscore parts words.
_WORD_START = r"(?<![^\W_])"
#: Where a word ends.
_WORD_END = r"(?![^\W_])"
#: A unit that a word may be glued to: "mmpp".
_AFTER_UNIT = r"(?:(?<=mm)|(?<=[u\u03bc]m)|(?<=deg)|(?<=rad))"
#: Words that count an amplitude peak-to-peak.
_PEAK_TO_PEAK = re.compile(
    rf"{_WORD_START}(?:{_PEAK}[\s_/-]*(?:(?:to|zu|a|2)[\s_-]*)?{_PEAK}|p[\s_./-]?(?:t[\s_./-]?|2[\s_./-]?)?p"
    rf"|c[\s-]a[\s-]c|s[.-]?s)\.?{_WORD_END}|{_AFTER_UNIT}(?:pk?-?pk?|s-?s){_WORD_END}"
)
#: Words that count an amplitude zero-to-peak.
_ZERO_TO_PEAK = re.compile(
    rf"{_WORD_START}(?:(?:zero|null|cero|0)[\s_/-]*(?:(?:to|bis|zu|a|2)[\s_-]*)?(?:{_PEAK}|p))\.?{_WORD_END}"
)
_CONVENTIONS: tuple[tuple[re.Pattern[str], AmplitudeConvention], ...] = (
    (_ZERO_TO_PEAK, "zero-to-peak"),
    (_PEAK_TO_PEAK, "peak-to-peak"),
)
#: Characters of the longest header that is compared; chosen: a longer one is a text and no name.
_LONGEST_HEADER = 200
#: What is left of brackets that held no more than a convention.
_EMPTY_BRACKETS = re.compile(r"[\[(]\s*[\])]")
#: Full-width brackets and typographic primes as their plain signs; quotation marks go.
_SPELLINGS: dict[int, int | str] = {
    **str.maketrans("\uff08\uff09\uff3b\uff3d\u2032\u2019\u00b4", "()[]'''"),
    **{0x2033: "''", ord('"'): ""},
}
#: Where a name may end and a unit begin, other than at a bracket: "force_N", "Kraft in N", "F / kN", "load, N".
_NAME_END = re.compile(r"\s+in\s+|\s*/\s*|\s*,\s*|\s+|_")


@dataclass(frozen=True)
class Column:
    """A column of a file.

    Args:
        role: what it holds, a key of LOOP_COLUMNS or SWEEP_COLUMNS.
        header: its header cell.
        index: its place among the columns, from 0.
        unit: its unit as the file or the user states it; None where neither does.
        scale: factor from that unit to SI.
        convention: how it counts amplitudes, where its header or unit says so.
    """

    role: str
    header: str
    index: int
    unit: str | None
    scale: float = 1.0
    convention: AmplitudeConvention | None = None


@dataclass(frozen=True)
class Heading:
    """What a header cell says of its column: its role, its unit as written, and how it counts amplitudes."""

    role: str
    unit: str | None = None
    convention: AmplitudeConvention | None = None


class Vocabulary:
    """What headers mean: the role, unit and convention that each states.

    Args:
        names: for each role the names it usually goes by.
        columns: for each role that goes by another name this name; the usual ones then do not count.
    """

    def __init__(self, names: Mapping[str, Sequence[str]], columns: Mapping[str, str]) -> None:
        self._roles = {
            plain(name): role
            for role, usual in names.items()
            for name in ([columns[role]] if role in columns else usual)
        }
        self._known: dict[str, Heading | None] = {}

    def heading(self, header: str) -> Heading | None:
        """What a header cell says; None where it names no role."""
        if header not in self._known:
            self._known[header] = self._read(header) if len(header) <= _LONGEST_HEADER else None
        return self._known[header]

    def roles(self, cells: Sequence[str]) -> set[str]:
        """The roles that some header cells name."""
        return {heading.role for cell in cells if (heading := self.heading(cell))}

    def _read(self, header: str) -> Heading | None:
        whole = header.translate(_SPELLINGS)
        text, convention = split_convention(whole)
        if plain(header) in self._roles:  # a campaign may name a header with its unit
            name, unit = units.split_header(text)
            double = plain(name) in _PEAK_TO_PEAK_NAMES
            return Heading(self._roles[plain(header)], unit, "peak-to-peak" if double else convention)
        # and a header with the words that tell its convention
        for name, unit, certain in (split for way in dict.fromkeys((text, whole)) for split in _splits(way)):
            bare, without_asides = plain(name), plain(_ASIDES.sub("", _folded(name)))
            double = bare in _PEAK_TO_PEAK_NAMES
            counted = "peak-to-peak" if double else convention
            for candidate in (
                bare,
                without_asides,
                *([bare + "amplitude"] if counted else []),
                *(["amplitude"] if double else []),
            ):
                role = self._roles.get(candidate)
                if role is None or not (certain or units.is_unit(unit or "")):
                    continue
                if not (candidate == "f" and unit and any(units.agrees(unit, si) for si in _UNITS_NOT_F[role])):
                    return Heading(role, unit, counted)
        return None


@lru_cache(maxsize=4096)
def split_convention(text: str) -> tuple[str, AmplitudeConvention | None]:
    """A header or unit without the words that tell how amplitudes are counted, and the convention they tell."""
    folded = _folded(text)
    for pattern, convention in _CONVENTIONS:
        if found := pattern.search(folded):
            rest = text[: found.start()] + " " + text[found.end() :]
            return _EMPTY_BRACKETS.sub("", rest).strip(), convention
    return text.strip(), None


@lru_cache(maxsize=4096)
def plain(name: str) -> str:
    """A name in the one spelling that is compared: letters, digits and ' | * alone, no case, accents or umlauts."""
    letters = re.sub(r"[^\w'|*]|_", "", _folded(name.translate(_SPELLINGS)).replace("ß", "ss"))
    return letters.replace("ae", "a").replace("oe", "o").replace("ue", "u")


def _splits(text: str) -> Iterator[tuple[str, str | None, bool]]:
    """Name and unit for each way to take a header apart, and whether the unit is certain or has yet to be known."""
    name, unit = units.split_header(text)
    yield name, unit, True
    if unit is None:
        for cut in _NAME_END.finditer(name):
            yield name[: cut.start()], name[cut.end() :].replace("_", " "), False


def _folded(text: str) -> str:
    """A text in lower case without accents, of the same length."""
    return "".join(unicodedata.normalize("NFKD", letter)[0] for letter in text.lower())
