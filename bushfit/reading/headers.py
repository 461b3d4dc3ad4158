"""Meaning of column headers: role, unit, amplitude convention and logarithm."""

import re
import tomllib
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeVar, get_args

from bushfit import units

#: Known words in column headers, names and labels, from words.toml, by table and key.
WORDS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
#: Next steps that errors suggest, by what is missing.
HINTS: Mapping[str, str] = WORDS.pop("hints")
#: Arguments of errors whose texts do not depend on the file (problem, expected, hint), by what is wrong.
ERRORS: Mapping[str, dict[str, Any]] = WORDS.pop("errors")


def _expand(name: str) -> list[str]:
    """Expand a column name: a part in braces, such as {base}, is replaced by each of the words it stands for."""
    if (part := re.search(r"{(\w+)}", name)) is None:
        return [name]
    words = {
        **WORDS["parts"],
        **{role: WORDS["loop"][role] for role in ("displacement", "force")},
        "strain": WORDS["straining"]["displacement"],
    }
    return [full for word in words[part[1]] for full in _expand(name.replace(part[0], word, 1))]


def _columns_of(test: str) -> dict[str, list[str]]:
    """Accepted column names for each role, such as "force", in a kind of test: the table `test` of words.toml."""
    return {role: [full for name in names for full in _expand(name)] for role, names in WORDS[test].items()}


#: Names of the columns of a loop, a sweep, a test of strain and modulus, a resonance test (a mass on a mount on a
#: shaker) and a displacement history, by role: the quantity in the column.
SWEEP_COLUMNS, STRAINING_COLUMNS = _columns_of("sweep"), _columns_of("straining")
LOOP_COLUMNS = {**_columns_of("loop"), **{role: SWEEP_COLUMNS[role] for role in ("temperature", "preload")}}
RESONANCE_COLUMNS = {"frequency": SWEEP_COLUMNS["frequency"], **_columns_of("resonance")}
DISPLACEMENT_COLUMNS = _columns_of("displacements") | {role: LOOP_COLUMNS[role] for role in ("time", "displacement")}
_OF_TESTS = (SWEEP_COLUMNS, STRAINING_COLUMNS, LOOP_COLUMNS, RESONANCE_COLUMNS, DISPLACEMENT_COLUMNS)
#: Names of the columns of all kinds of tests, by role, with which the header of a table is found.
ALL_COLUMNS = {
    role: [name for names in _OF_TESTS for name in names.get(role, ())]
    for role in dict.fromkeys(role for names in _OF_TESTS for role in names)
}
#: Roles with a common property, in a fixed order, by property (see words.toml).
ROLE_SETS = {kind: dict.fromkeys(roles).keys() for kind, roles in WORDS["role_sets"].items()}
#: Convention by which an amplitude is stated.
AmplitudeConvention = Literal["zero-to-peak", "peak-to-peak", "rms"]
#: Largest or smallest value in each cycle of an oscillating quantity.
Extreme = Literal["maximum", "minimum"]
#: Factor that converts an amplitude to zero-to-peak, by its convention.
ZERO_TO_PEAK: dict[AmplitudeConvention, float] = {"zero-to-peak": 1.0, "peak-to-peak": 0.5, "rms": 2.0**0.5}
#: Text of each amplitude convention in the header of an added column.
COUNTED: dict[AmplitudeConvention | None, str] = {
    "peak-to-peak": " p-p", "zero-to-peak": " 0-p", "rms": " rms", None: ""
}  # fmt: skip
Meant = TypeVar("Meant")
#: Channel of a test rig in brackets: "Load(Linear:Load) (kN)".
_CHANNEL = re.compile(r"\((?:[^()]|\([^()]*\))*[:|](?:[^()]|\([^()]*\))*\)")
#: Loss factor written as a function, with brackets that do not contain a unit.
_TAN = re.compile(r"(?i)\bt(?:an|g)\s*\(\s*(delta|d|δ|φ)\s*\)")
#: Logarithm of a quantity: "log10 f [Hz]", "lg(G') [Pa]", "log10(K*/(N/m))". The base of a plain log is not known.
_LOGARITHM = re.compile(
    r"(?i)\s*(?P<kind>log[\s_]?10|lg|ln|log)(?=[\s_(])[\s_]*(?:\((?P<inner>(?:[^()]|\([^()]*\))*)\))?"
)
#: Logarithm in a unit: "log10(Pa)", "ln(Pa)", "dB re 1 N/mm", "dB (N/mm)".
_LOGARITHM_OF_UNIT = re.compile(
    r"(?:(?:log_?10|lg|(?P<ln>ln))\s*\(|(?P<dB>dB)\s*\(?(?:\s*rel?f?\.?(?![^\W_]))?(?:\s*1(?=\s))?)\s*(?P<unit>[^()]*)\)?"
)
#: Reference of decibels in brackets of its own, or behind the unit: "dB (re 1 N/m)", "[dB] re 1 N/m".
_DECIBELS = re.compile(r"(?:\s+in\s+|\s*/\s*|\s+)?[\[(]?\bdB\s*[\])]?\s*[\[(]?\s*(rel?f?\.?\s[^()\[\]]*)[\])]?$")
#: Symbol of a stiffness or modulus, in the spelling that `plain` returns: k', |k*|, g''.
_SYMBOL = re.compile(r"\|?[a-z]{1,4}(?:\*|'{1,2})\|?|\|[a-z]\|")
#: Words in a name whose symbol does not tell what the column is: a mean of K*, the imaginary part of K*.
_UNLIKE_SYMBOL = frozenset(word for kind in ("not_measured", "real", "imaginary") for word in WORDS["qualifiers"][kind])
#: Symbol of a travel over its unit, which is no unit of seconds: "s / mm"; and quotation mark for two primes: G".
_TRAVEL, _TWO_PRIMES = re.compile(r"s\s*/"), re.compile(r"(?<![^\W_])([A-Za-z])\"")
#: Quantity on the x axis in the name of a curve: "K* vs frequency [N/mm]", "K*(f)".
VERSUS = re.compile(r"\s+(?:vs\.?|versus|over|über)\s+(?P<x>[^\[(]*[^\s\[(])|\s?\(f\)", re.IGNORECASE)
#: Words that do not change the meaning of a channel.
_ASIDES = re.compile(r"\b(?:axial|radial|torsional|measured|actual|gemessen|mesure|medido|ist)\b")
#: Words for the mean of several parts, which do not change the meaning of a stiffness or its loss.
_MEANS = re.compile(rf"\b(?:{'|'.join(WORDS['qualifiers']['means'])})\b")
#: Footnote marks in a name.
_FOOTNOTES = str.maketrans("", "", "\u00b9\u00b2\u00b3\u2070\u2074\u2075\u2076\u2077\u2078\u2079\u2020\u2021")
#: Units with which the symbol f cannot mean a role, by name and role.
_UNITS_NOT_F = {("f", "force"): ("Hz",), ("famplitude", "force_amplitude"): ("Hz",), ("f", "frequency"): ("N", "N m")}
#: Units that a role cannot have: "Amplitude [N/m]" is the magnitude of a stiffness.
_UNITS_NOT = {"amplitude": ("N/m", "N*m/rad")}
#: Units with which a short or ambiguous name means a role, by name and role.
UNITS_OF = {
    (name, role): si
    for role, entries in WORDS["units_of"].items()
    for name, *si in (entry.split() for entry in entries)
}
#: Names of an amplitude that imply peak-to-peak.
PEAK_TO_PEAK_NAMES = frozenset(WORDS["counting"]["peak_to_peak"])
#: Parts of the patterns of conventions: ends of words, and the end of a symbol ("Fmax") or unit ("mmpp") before them.
_PARTS = {part: "|".join(WORDS["conventions"][part]) for part in ("start", "symbol", "end", "unit", "peak")}
#: Key in words.toml of the words for each convention, in the order in which they are tried.
_CONVENTION_KEYS: dict[str, AmplitudeConvention] = {
    "zero_to_peak": "zero-to-peak", "peak_to_peak": "peak-to-peak", "rms": "rms", "lone_peak": "zero-to-peak"
}  # fmt: skip
_CONVENTIONS = [
    (re.compile("|".join(WORDS["conventions"][key]).format(**_PARTS)), convention)
    for key, convention in _CONVENTION_KEYS.items()
]
#: Patterns of the largest and smallest value of a cycle, from which an amplitude is computed.
_EXTREMES: list[tuple[re.Pattern[str], Extreme]] = [
    (re.compile("|".join(WORDS["conventions"][extreme]).format(**_PARTS)), extreme) for extreme in get_args(Extreme)
]
#: Characters of the longest header that is compared; chosen: longer texts are not names.
_LONGEST_HEADER = 200
#: Boundary of words in "AmpPkPk"; brackets and comma that remain after a convention was removed: "()", "(mm, )".
_CAMEL, _EMPTY_BRACKETS = re.compile(r"(?<=[a-z]{2})(?=[A-Z])"), re.compile(r"[\[(]\s*[\])]")
_DANGLING = re.compile(r"\s*[,;]\s*(?=[\])]|$)|(?<=[\[(])\s*[,;]\s*")
#: Full-width brackets and typographic primes as plain signs; quotation marks are dropped.
_SPELLINGS: dict[int, int | str] = {
    **str.maketrans("\uff08\uff09\uff3b\uff3d\u2032\u2019\u00b4", "()[]'''"),
    **{0x2033: "''", ord('"'): ""},
    **units.FULL_WIDTH,
}
#: End of a name before a unit without brackets: "force_N", "Kraft in N", "F / kN", "load, N".
_NAME_END = re.compile(r"\s+in\s+|\s*/\s*|\s*,\s*|\s+|_")
#: Newton per a length in a name without signs: "n_per_mm", "n_mm", "Npmm"; and the word before a part of such a unit.
_PER_OF_NEWTON = re.compile(r"(?<![^\W_])(k?)(?:n[ _](?:per[ _])?|[nN]p)(?=m)")
_PER = re.compile(r"(?<![^\W_])per$")


@dataclass(frozen=True)
class Heading:
    """Meaning of a header cell.

    Args:
        role: quantity in the column, such as "displacement".
        unit: unit as written in the file or campaign; None if there is none.
        convention: convention of an amplitude; None if neither header nor unit states it.
        logarithm: base of the logarithm if the column contains logarithms; 0 for plain values, NaN for an unknown base.
        extreme: largest or smallest value of each cycle; half of their difference is the amplitude, which is the role.
    """

    role: str
    unit: str | None = None
    convention: AmplitudeConvention | None = None
    logarithm: float = 0.0
    extreme: Extreme | None = None


@dataclass(frozen=True, kw_only=True)
class Column(Heading):
    """Column of a table, with its meaning.

    Args:
        header: text of the header cell.
        index: position of the column, from 0.
        scale: factor from the unit to SI.
        terms: positions of columns that are added to this one, each with its sign: -1 for minima beside maxima.
    """

    header: str
    index: int
    scale: float = 1.0
    terms: tuple[tuple[int, float], ...] = ()

    @property
    def indices(self) -> tuple[int, ...]:
        """Indices of the columns from which its values are computed: one, or more for a sum or difference."""
        return (self.index, *(index for index, _ in self.terms))


class Vocabulary:
    """Dictionary of column names: finds the unit and the role (the quantity, such as "force") of a header.

    Args:
        names: usual column names, by role.
        columns: column name given by the user, by role; it replaces the usual names of the role.
        stated_units: unit given by the user, by role; it replaces the unit of the header.
    """

    def __init__(
        self,
        names: Mapping[str, Sequence[str]],
        columns: Mapping[str, str] = MappingProxyType({}),
        stated_units: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._stated_units = stated_units
        self._stated = {plain(name): role for role, name in columns.items() if role in names}
        usual = _roles_by_name(tuple((role, *usual) for role, usual in names.items() if role not in columns))
        self._roles = {**usual, **{name: [role] for name, role in self._stated.items()}}
        self._known: dict[tuple[str, str | None], Heading | None] = {}
        self._names = {role: usual[0] for role, usual in names.items()} | dict(columns)

    def heading(self, header: str, unit_below: str | None = None) -> Heading | None:
        """Return the meaning of a header cell by its name and unit together.

        Args:
            header: text of the cell.
            unit_below: unit of the column in a units row, "" without one; None if it is not known yet.

        Returns:
            Meaning of the header, with the unit that it contains; None if it names no known role with this unit.
        """
        key = header, unit_below
        if key not in self._known:
            self._known[key] = self._read(*key) if len(header) <= _LONGEST_HEADER else None
        return self._known[key]

    def name_of(self, role: str) -> str:
        """Return the column name that the user gave for a role such as "force", or else its first usual name."""
        return self._names[role]

    def roles(self, cells: Sequence[str]) -> set[str]:
        """Return the roles, such as "force", of the columns with these header cells."""
        return {heading.role for cell in cells if (heading := self.heading(cell))}

    def _read(self, header: str, unit_below: str | None) -> Heading | None:
        """Find the meaning of a header cell without the cache of `heading`."""
        text = _TAN.sub("tan delta", _CHANNEL.sub("", VERSUS.sub("", header)))
        text = _TWO_PRIMES.sub(r"\1''", text).translate(_SPELLINGS)
        text = _DECIBELS.sub(r" [dB \1]", text)
        logarithm = 0.0
        if match := _LOGARITHM.match(text):
            logarithm = {"ln": 2.718281828459045, "log": float("nan")}.get(match["kind"].lower(), 10.0)
            text = f"{(match['inner'] or '').replace('/', ' ', 1)} {text[match.end() :]}".strip()
        if plain(header) in self._stated:  # a campaign may name a header together with its unit
            name, unit, convention = split_unit(text)
            counting = "peak-to-peak" if plain(name) in PEAK_TO_PEAK_NAMES else convention
            return Heading(self._stated[plain(header)], None if unit == name else unit, counting, logarithm)
        without, convention = split_convention(text)  # tried before the whole header
        without, extreme = (without, None) if convention else split_extreme(text)
        forms = dict.fromkeys((without, text))
        for is_first, (name, unit, certain) in ((form is without, one) for form in forms for one in _splits(form)):
            is_extreme = extreme is not None and is_first
            if unit is None and name.endswith(("%", "‰", "°")):
                continue  # the unit without a bracket
            bare, without_asides = plain(name), plain(_ASIDES.sub("", folded(name)))
            implied: AmplitudeConvention | None = "peak-to-peak" if bare in PEAK_TO_PEAK_NAMES else convention
            amplitudes = [word + "amplitude" for word in (bare, without_asides) if implied or (extreme and word)]
            amplitudes += ["amplitude"] * (bare in PEAK_TO_PEAK_NAMES) + [f"{bare}extreme"] * is_extreme
            of_mean = without_mean(name)
            for word in (
                bare,
                without_asides,
                *([of_mean] if ROLE_SETS["of_means"] & self._roles.get(of_mean, ()) else []),
                *amplitudes,
                *self._names_with_symbol(name, unit),
            ):
                for role in self._roles.get(word, ()):
                    if unit and role in self._roles.get(plain(unit), ()):
                        unit = None  # a symbol instead of a unit: "Loss factor (tan d)"
                    if extreme and role not in (("amplitude", "force_amplitude") if is_extreme else ("time",)):
                        continue  # "min" is no unit but of a time
                    is_unit = units.is_unit if role != "temperature" else units.kelvin_scale
                    column_unit = unit or (unit_below and parse_unit(unit_below)[0]) or unit_below
                    fitting = role in self._stated_units or can_have_role(word, role, column_unit)
                    if (certain or is_unit(unit or "")) and fitting:
                        return Heading(role, unit, implied, logarithm, extreme if is_extreme else None)
        return None

    def _names_with_symbol(self, name: str, unit: str | None) -> Iterator[str]:
        """Yield the names in a header that consists of words and a symbol, such as "Storage modulus G'" or "Weg s".

        If the words are not known, the symbol of a stiffness is a name, as in "Rigidezza elastica K' [N/mm]".
        """
        for blank in re.finditer(r"[\s,(]+", name):
            word, symbol = plain(name[: blank.start()]), plain(name[blank.end() :])
            if word in self._roles and set(self._roles[word]) & set(self._roles.get(symbol, ())):
                yield word
            elif _SYMBOL.fullmatch(symbol) and _UNLIKE_SYMBOL.isdisjoint(folded(name).split()):
                yield from [symbol] * any(units.is_compatible(unit or "", si) for si in ("N/m", "N*m/rad", "Pa"))


@lru_cache(maxsize=16)
def _roles_by_name(names: tuple[tuple[str, ...], ...]) -> Mapping[str, list[str]]:
    """Roles of each usual column name in plain letters; each entry of `names` is a role, then its names."""
    roles: dict[str, list[str]] = {}
    for role, *usual in names:
        for name in dict.fromkeys(map(plain, usual)):
            roles.setdefault(name, []).append(role)
    return roles


def can_have_role(word: str, role: str, unit: str | None) -> bool:
    """Check by its unit whether a column with an ambiguous name, such as "f", can have a role, such as "force".

    Args:
        word: column name, in the spelling that `plain` returns.
        role: role that the name may mean.
        unit: unit of the column, "" if it has none; None if it is not known.

    Returns:
        True unless the unit excludes the role.
    """
    if unit == "" and (role in ROLE_SETS["needing_units"] or word == "k"):
        return False
    if word == "t" and role in ("time", "temperature") and unit is not None:
        return bool(units.kelvin_scale(unit)) == (role == "temperature")
    if unit and (expected := UNITS_OF.get((word, role))):
        return any(units.is_compatible(unit, si) for si in expected)
    excluded = (*_UNITS_NOT_F.get((word, role), ()), *_UNITS_NOT.get(role, ()))
    return not any(units.is_compatible(unit or "", si) for si in excluded)


@lru_cache(maxsize=4096)
def split_convention(text: str) -> tuple[str, AmplitudeConvention | None]:
    """Split "amplitude p-p [mm]" into "amplitude [mm]" and "peak-to-peak"; None for a text without a convention."""
    return _split_off(text, _CONVENTIONS)


@lru_cache(maxsize=4096)
def split_extreme(text: str) -> tuple[str, Extreme | None]:
    """Split "Disp max [mm]" into "Disp [mm]" and "maximum"; None for a text without such a word."""
    return _split_off(text, _EXTREMES)


def _split_off(text: str, patterns: Sequence[tuple[re.Pattern[str], Meant]]) -> tuple[str, Meant | None]:
    """Split a text into the part that matches no pattern, and the meaning of the first matching pattern, or None."""
    for form in dict.fromkeys((text, _CAMEL.sub(" ", text))):
        for pattern, meaning in patterns:
            if match := pattern.search(folded(form)):
                rest = form[: match.start()] + " " + form[match.end() :]
                return _EMPTY_BRACKETS.sub("", _DANGLING.sub("", rest)).strip(), meaning
    return text.strip(), None


def parse_unit(text: str) -> tuple[str, AmplitudeConvention | None, float]:
    """Parse a unit that may contain an amplitude convention ("mm p-p") or a logarithm ("log10(Pa)", "dB re 1 N/mm").

    Returns:
        Bare unit, convention or None, and base of the logarithm: 0 without one, 10^(1/20) for dB.
    """
    base = 0.0
    if match := _LOGARITHM_OF_UNIT.fullmatch(text):
        base = 10.0**0.05 if match["dB"] else 2.718281828459045 if match["ln"] else 10.0
        text = match["unit"]
    return *split_convention(text), base


@lru_cache(maxsize=1 << 15)  # the vocabularies have five thousand names
def plain(name: str) -> str:
    """Normalise a name for comparison: only letters, digits and ' | *, in lower case without accents."""
    letters = re.sub(r"[^\w'|*]|_", "", folded(name.translate(_FOOTNOTES).translate(_SPELLINGS)).replace("ß", "ss"))
    return letters.replace("ae", "a").replace("oe", "o").replace("ue", "u")


def without_mean(name: str) -> str:
    """Name in plain letters (see `plain`) without a word for the mean of several parts or repeats."""
    return plain(_MEANS.sub("", folded(name)))


def plain_name(header: str) -> str:
    """Name in a column header, in plain letters (see `plain`): "force" of "Force p-p [N]"."""
    return plain(units.split_header(split_convention(header)[0])[0])


def split_unit(header: str) -> tuple[str, str | None, AmplitudeConvention | None]:
    """Return name, unit and amplitude convention of a header of unknown meaning; None if not in the header."""
    text, convention = split_convention(header)
    for name, unit, certain in _splits(text):
        if certain and unit is None and units.is_unit(name) and name != "-" and not _TRAVEL.match(name):
            return name, name, convention  # a unit alone
        if unit and (certain or units.is_unit(unit)):
            return name, unit, convention
    return text, None, convention


def units_in_header(header: str) -> Iterator[str]:
    """Yield each text in a header that may be its unit: kN/mm, mm and N_mm of "Kdyn_N_mm [kN/mm]"."""
    name, unit = units.split_header(header)
    yield from (one for _, one, _ in _splits(name) if one)
    if unit:
        yield from (unit, *units_in_header(name))


def _splits(text: str) -> Iterator[tuple[str, str | None, bool]]:
    """Yield each split of a header, such as "force_N": name, unit or None, and True if the unit is in brackets."""
    name, unit = units.split_header(text)
    if unit and name[-1:] in ("]", ")") and not units.is_unit(unit):
        yield from _splits(name)  # "Force [kN] (front)"
    yield name, unit, True
    if unit is None:
        for end in reversed(list(_NAME_END.finditer(name))):
            text = _PER_OF_NEWTON.sub(r"\1N/", name[end.end() :].strip(" _"))
            text = "N" if text == "n" and end.start() > 1 else text  # "force_n" in names without capitals
            if _PER.search(name[: end.start()]):
                continue  # a part of a unit such as N_per_mm
            is_count = units.is_number(text) and (text != "1" or "/" not in end[0])  # the first of several
            if not (text.startswith("dyn") or is_count):  # dynamic, and no dyne
                yield name[: end.start()], text, False


@lru_cache(maxsize=4096)
def folded(text: str) -> str:
    """Text in lower case without accents, with the same number of characters; syllables of Hangul stay whole."""
    return "".join(
        letter if "가" <= letter <= "힣" else unicodedata.normalize("NFKD", letter)[0] for letter in text.lower()
    )
