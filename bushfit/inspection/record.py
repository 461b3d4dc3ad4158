"""What an inspection of a test file finds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from typing_extensions import Doc, TypedDict

from bushfit.effects.contract import Array
from bushfit.geometry import Place, Specimen
from bushfit.reading.instruments import word_for_part
from bushfit.reading.measurement import Loop, Sweep
from bushfit.validation import plain

#: A hysteresis loop, a sweep, or the raw history of a stepped sine.
Kind = Literal["loop", "sweep", "history"]


def told_frequencies(frequencies: Sequence[float] | Array) -> str:
    """How many frequencies there are, and between which they lie: "16, from 5 to 155 Hz"; [Hz], rising, (n,)."""
    low, high = (f"{end:.4g}" for end in (frequencies[0], frequencies[-1]))
    return f"{len(frequencies)}, {f'at {low}' if low == high else f'from {low} to {high}'} Hz"


@dataclass(frozen=True)
class ColumnSeen:
    """A column of a file.

    Args:
        header: its cell.
        role: that it was taken for; None where it is not needed.
        unit: of its numbers; None where it is not stated.
        low, high: the range of its values in that unit; None where they were not read.
    """

    header: str
    role: str | None
    unit: str | None
    low: float | None = None
    high: float | None = None


class InspectedFile(TypedDict):
    """A file, or a sheet of a workbook, and what was found in it."""

    file: Annotated[str, Doc("as it was named.")]
    sheet: Annotated[str | int | None, Doc("of a workbook; null where there is one only.")]
    kind: Annotated[Kind, Doc("a hysteresis loop, a sweep, or the raw history of a stepped sine.")]
    direction: Annotated[str | None, Doc("of the test, or specimen; null where neither file nor options say it.")]
    written: Annotated[
        dict[str, str], Doc("how the file is written, by label: encoding, delimiter, decimal mark and so on.")
    ]
    columns: Annotated[tuple[ColumnSeen, ...], Doc("all of them, in order.")]
    facts: Annotated[dict[str, str], Doc("in words, by label.")]
    assumed: Annotated[
        str | None, Doc("what was assumed, with the option or key that says otherwise; null where nothing was.")
    ]
    odd: Annotated[list[str], Doc("a sentence for each thing that is odd.")]


class InspectionDocument(TypedDict):
    """What test files hold."""

    files: Annotated[list[InspectedFile], Doc("that can be used.")]
    left_out: Annotated[list[str], Doc("a sentence for each file or sheet that holds no test.")]
    campaign: Annotated[str, Doc("the text for a campaign, or a whole one.")]


#: What the content of a file tells: facts in words, by label, and a sentence for each thing that is odd.
Findings = tuple[dict[str, str], list[str]]


@dataclass(frozen=True, eq=False)
class Inspected:
    """A test file that can be used, with all that an inspection finds.

    Args:
        file, kind, measured: the file, what it holds, and its content in SI.
        direction: of the test; None where neither file nor options say it.
        written, columns, facts, odd: as `InspectedFile` has them.
        entry: keys of its table in a campaign besides `file` and `direction`, as TOML has them.
        counted: whether the header of a sweep says how amplitudes are counted.
    """

    file: Path
    kind: Kind
    direction: Place | None
    written: Mapping[str, str]
    columns: tuple[ColumnSeen, ...]
    facts: Mapping[str, str]
    odd: tuple[str, ...]
    entry: Mapping[str, Any] = field(default_factory=dict)
    measured: Loop | Sweep | None = None
    counted: bool = False

    @property
    def label(self) -> str:
        """The name of the file, with the sheet where it has several, and with what columns tell of the test."""
        direction = self.direction if "direction" in [one.role for one in self.columns] else None
        added = {word_for_part(self.file): self.entry.get("sheet"), "direction": direction, "part": self.part}
        added |= self.entry.get("rows", {})
        return ", ".join([self.file.name, *(f"{key} {value}" for key, value in added.items() if value)])

    @property
    def part(self) -> str | None:
        """The number of its specimen as a column tells it; None where none does."""
        return self.entry["specimen_number"] if "specimen number" in [one.role for one in self.columns] else None

    @property
    def is_counting_open(self) -> bool:
        """Whether nothing says how the amplitudes of a sweep are counted."""
        return self.kind == "sweep" and not self.counted and "amplitude" not in self.entry

    @property
    def assumed(self) -> str | None:
        """What was assumed, with the option or key that says otherwise; None where nothing was."""
        said = []
        if isinstance(self.direction, Specimen) and self.direction.kind == "modulus":
            taken, other = "the engineering shear strain", "tension"
            if self.direction.strain == "tension":
                taken, other = "that of a bar in tension", "engineering"
            said.append(f'its strain is taken as {taken}, else strain = "{other}" or "tensor" in [[specimens]]')
        if self.is_counting_open:
            what = "nothing says" if "at_amplitude" in self.entry else "its header does not say"
            said.append(f"{what} how amplitudes are counted: taken zero-to-peak, else --amplitude peak-to-peak")
        return "; ".join(said) or None

    def to_document(self) -> InspectedFile:
        """All of it but the content, as JSON has it."""
        return {
            "file": str(self.file),
            "sheet": self.entry.get("sheet"),
            "kind": self.kind,
            "direction": str(self.direction) if self.direction else None,
            "written": dict(self.written),
            "columns": plain(self.columns, tuple[ColumnSeen, ...]),
            "facts": dict(self.facts),
            "assumed": self.assumed,
            "odd": list(self.odd),
        }
