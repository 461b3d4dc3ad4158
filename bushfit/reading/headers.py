"""What the header of a column says in a test file: its role, its unit, and how it counts amplitudes."""

import re
import tomllib
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

from bushfit import units
from bushfit.geometry import STRAINING, Motion

#: The words of words.toml, by table and key.
WORDS: Mapping[str, Mapping[str, Sequence[str]]] = tomllib.loads(
    Path(__file__).with_name("words.toml").read_text(encoding="utf-8")
)
#: For each column of a loop, the headers it goes by.
LOOP_COLUMNS = WORDS["loop"]
#: For each column of a sweep, the headers it goes by.
SWEEP_COLUMNS = WORDS["sweep"]
#: For each column that says which test a row belongs to, by key, the headers it goes by.
ROW_COLUMNS = {**WORDS["rows"], "specimen_number": WORDS["above"]["specimen_number"], "run": SWEEP_COLUMNS["repeat"]}
#: For each column of a test of strain and modulus, the headers it goes by in place of those above.
_STRAINING = {role: names for role, names in WORDS["straining"].items() if role != "amplitude_of"} | {
    "amplitude": [
        *SWEEP_COLUMNS["amplitude"],
        *(
            way.format(strain)
            for strain in WORDS["straining"]["displacement"]
            for way in WORDS["straining"]["amplitude_of"]
        ),
        *WORDS["straining"]["amplitude"],
    ]
}
#: The columns of which the headers depend on the motion: those of what moves and of what resists it.
OF_MOTION = (*_STRAINING, "amplitude_reached")
#: How an amplitude is counted.
AmplitudeConvention = Literal["zero-to-peak", "peak-to-peak"]
#: How the headers of a frequency in radians begin.
_ANGULAR = ("angular", "angfreq", "omega", "ω", "kreisfrequenz", "pulsation", "角频率")
#: What a rig writes of a channel in brackets: "Load(Linear:Load) (kN)".
_CHANNEL = re.compile(r"\([^()]*[:|][^()]*\)")
#: The loss factor as a function, of which the brackets hold no unit.
_TAN = re.compile(r"(?i)\btan\s*\(\s*(delta|d|δ)\s*\)")
#: A quotation mark that stands for two primes: G".
_TWO_PRIMES = re.compile(r"(?<![^\W_])([A-Za-z])\"")
#: Words that tell where or how a channel was recorded, but not what it is.
_ASIDES = re.compile(r"\b(?:axial|radial|torsional|measured|actual|gemessen|mesure|medido|ist)\b")
#: For the roles that the symbol f may stand for, units by which it stands for the other one.
_UNITS_NOT_F = {"force": ("Hz",), "frequency": ("N", "N m")}
#: Units by which a symbol stands for its role: A for an amplitude and not for an area, K for a stiffness.
_UNITS_OF = {"a": ("m", "rad"), "k": ("N/m", "N*m/rad")}
#: Names of an amplitude that count it peak-to-peak by themselves.
_PEAK_TO_PEAK_NAMES = frozenset(WORDS["counting"]["peak_to_peak"])
#: The word "peak".
_PEAK = r"(?:peak|pk|spitze|sp\.?|crete|cresta|pico|pic)"
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


def _made_of(body: str, quantity: str) -> list[str]:
    """Every name of a quantity, such as "acceleration", before and after every name of a body, such as "base"."""
    parts = WORDS["resonance_parts"]
    return [way for name in parts[body] for word in parts[quantity] for way in (f"{name} {word}", word + name)]


#: For each column of a resonance test (a mass on a mount on a shaker), the headers it goes by.
RESONANCE_COLUMNS: Mapping[str, Sequence[str]] = {
    "frequency": SWEEP_COLUMNS["frequency"],
    **{f"{body}_{word}": _made_of(body, word) for word in ("acceleration", "phase") for body in ("base", "mass")},
    **WORDS["resonance"],
    **{
        f"{body}_{part}": [
            f"{name} {word}" for name in _made_of(body, "acceleration") for word in WORDS["resonance_parts"][part]
        ]
        for body in ("base", "mass")
        for part in ("real", "imaginary")
    },
}


def of_motion(names: Mapping[str, Sequence[str]], motion: Motion) -> dict[str, Sequence[str]]:
    """The headers that columns go by in a test of one kind of motion: G' names a modulus, and no stiffness."""
    return {role: _STRAINING.get(role, usual) if motion is STRAINING else usual for role, usual in names.items()}


@dataclass(frozen=True)
class Column:
    """A column of a file, by its index from 0: what it holds, its header cell, and its unit as it is stated, if it is.

    `scale` is the factor from that unit to SI, `convention` how it counts amplitudes, where header or unit say so.
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
        whole = _TWO_PRIMES.sub(r"\1''", _TAN.sub("tan delta", _CHANNEL.sub("", header))).translate(_SPELLINGS)
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
                *self._said_twice(name),
            ):
                role = self._roles.get(candidate)
                is_unit = units.is_unit if role != "temperature" else units.kelvin_scale
                if role is None or not (certain or is_unit(unit or "")):
                    continue
                if candidate in _UNITS_OF and not any(
                    units.is_compatible(unit or "", si) for si in _UNITS_OF[candidate]
                ):
                    continue
                if not (candidate == "f" and unit and any(units.is_compatible(unit, si) for si in _UNITS_NOT_F[role])):
                    return Heading(role, unit, counted)
        return None

    def _said_twice(self, name: str) -> Iterator[str]:
        """The word of a header that says one thing in two ways, such as "Storage modulus G'" or "Weg s"."""
        for blank in re.finditer(r"[\s,(]+", name):
            word, symbol = plain(name[: blank.start()]), plain(name[blank.end() :])
            if word in self._roles and self._roles[word] == self._roles.get(symbol):
                yield word


def is_angular(header: str, unit: str) -> bool:
    """Whether a frequency counts radians: its unit does, or its header says so and the unit counts nothing (1/s)."""
    name = plain(header)
    return units.is_compatible(unit, "rad/s") or (
        "hz" not in unit.lower()
        and any(name.startswith(plain(word)) for word in _ANGULAR)
        and units.is_compatible(unit, "Hz")
    )


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
        for cut in reversed(list(_NAME_END.finditer(name))):  # strain_dyn_pct is no strain in dyn %
            yield name[: cut.start()], name[cut.end() :].replace("_", " "), False


def _folded(text: str) -> str:
    """A text in lower case without accents, of the same length."""
    return "".join(unicodedata.normalize("NFKD", letter)[0] for letter in text.lower())
