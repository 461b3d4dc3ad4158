"""Result of the inspection of a test file, and the text of a campaign for inspected files."""

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any, Literal

from typing_extensions import Doc, TypedDict

from bushfit.campaign.toml import specimen_lines, toml_value
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError, printable
from bushfit.geometry import Place, Specimen
from bushfit.reading.instruments import word_for_part
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.tablefile import folder_name
from bushfit.validation import to_json_data

#: A hysteresis loop, a sweep, or the raw history of a stepped sine.
Kind = Literal["loop", "sweep", "history"]
#: What the content of a file tells: facts in words, by label, and a sentence for each unusual finding.
Findings = tuple[dict[str, str], list[str]]
#: For each kind of test the array of tables that lists it in a campaign.
_TABLES = {"loop": "loops", "sweep": "sweeps"}


def format_frequencies(frequencies: Sequence[float] | Array) -> str:
    """Number and range of frequencies [Hz], (n,), increasing, such as "16, from 5 to 155 Hz"."""
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
    written: Annotated[dict[str, str], Doc("format of the file by label: encoding, delimiter, decimal mark and so on.")]
    columns: Annotated[tuple[ColumnSeen, ...], Doc("all of them, in order.")]
    facts: Annotated[dict[str, str], Doc("in words, by label.")]
    assumed: Annotated[
        str | None, Doc("assumptions, each with the option or key that changes it; null if there are none.")
    ]
    odd: Annotated[list[str], Doc("a sentence for each unusual finding.")]


class InspectionDocument(TypedDict):
    """Contents of test files."""

    files: Annotated[list[InspectedFile], Doc("that can be used.")]
    left_out: Annotated[list[str], Doc("a sentence for each file or sheet that holds no test.")]
    campaign: Annotated[str, Doc("the text for a campaign, or a whole one.")]


@dataclass(frozen=True, eq=False)
class Inspection:
    """A test file that can be used, with all that an inspection finds.

    Args:
        file: test file.
        kind: loop, sweep or raw history.
        direction: direction or specimen of the test; None if neither file nor options state it.
        written, columns, facts, odd: see `InspectedFile`.
        entry: further keys of its table in a campaign, as TOML has them.
        measured: content in SI.
        counted: True if the header of a sweep states zero-to-peak or peak-to-peak.
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
        """Name of the file, with its sheet, direction and part where it holds several."""
        in_columns = {column.role for column in self.columns}
        direction = self.direction if "direction" in in_columns else None
        part = self.part if "specimen number" in in_columns else None
        added = {word_for_part(self.file): self.entry.get("sheet"), "direction": direction, "part": part}
        added |= self.entry.get("rows", {})
        return ", ".join([self.file.name, *(f"{key} {value}" for key, value in added.items() if value)])

    @property
    def part(self) -> str | None:
        """Number of its specimen by a column, the file's name or the lines above its table; None if it is not known."""
        number: str | None = self.entry.get("specimen_number")
        return number

    @property
    def is_counting_open(self) -> bool:
        """True for a sweep whose amplitudes may be zero-to-peak or peak-to-peak."""
        return self.kind == "sweep" and not self.counted and "amplitude" not in self.entry

    @property
    def assumed(self) -> str | None:
        """Assumptions, each with the option or key that changes it; None if nothing was assumed."""
        assumptions = []
        if isinstance(self.direction, Specimen) and self.direction.kind == "modulus":
            meaning, alternative = "the engineering shear strain", "tension"
            if self.direction.strain == "tension":
                meaning, alternative = "that of a bar in tension", "engineering"
            assumptions.append(
                f'its strain is read as {meaning}; otherwise state strain = "{alternative}" or "tensor" in '
                "[[specimens]]"
            )
        if self.is_counting_open:
            missing = "nothing says" if "at_amplitude" in self.entry else "the header does not state"
            assumptions.append(
                f"{missing} how amplitudes are counted: zero-to-peak is assumed; if they are peak-to-peak, add "
                "--amplitude peak-to-peak"
            )
        return "; ".join(assumptions) or None

    def to_document(self) -> InspectedFile:
        """Document of the inspection for JSON.

        Returns:
            Entries by key; the measured data are left out.
        """
        return {
            "file": str(self.file),
            "sheet": self.entry.get("sheet"),
            "kind": self.kind,
            "direction": str(self.direction) if self.direction else None,
            "written": dict(self.written),
            "columns": to_json_data(self.columns, tuple[ColumnSeen, ...]),
            "facts": dict(self.facts),
            "assumed": self.assumed,
            "odd": list(self.odd),
        }


def campaign_text(name: str, bushing: Mapping[str, str] | None, files: Sequence[Inspection], folder: Path) -> str:
    """Text of a whole campaign file.

    Args:
        name: of the campaign and of its bushing.
        bushing: other keys of [bushing], quantities as texts; None where specimens alone were tested.
        files: inspections of its tests.
        folder: folder of the campaign; files are named relative to it.
    """
    head = [*(["[bushing]"] if bushing else []), *key_lines({"name": name, **(bushing or {})}), ""]
    tests = [inspection for kind in _TABLES for inspection in files if inspection.kind == kind]
    report = "# [report] fills the head of the report: "
    report += 'customer = "...", part_number = "...", drawing, laboratory, date, logo\n'
    return "\n".join([*head, *campaign_tables(tests, folder), report])


def campaigns_of_parts(
    name: str, bushing: Mapping[str, str] | None, files: Sequence[Inspection], folder: Path, listed_in: str
) -> dict[str, str]:
    """Texts of one campaign for each part, and of the batch manifest that lists them.

    Args:
        name: of the bushing.
        bushing: other keys of [bushing], quantities as texts; None where specimens alone were tested.
        files: inspections, each with the number of its specimen.
        folder: folder of the campaigns.
        listed_in: name of the manifest.

    Returns:
        The texts by file name, the manifest first.

    Raises:
        CampaignError: a file without the number of its specimen.
    """
    of_parts = dict[str, list[Inspection]]()
    for inspection in files:
        of_parts.setdefault(inspection.part or "", []).append(inspection)
    if unknown := of_parts.pop("", []):
        raise CampaignError(
            "the part of this test is not stated",
            file=unknown[0].file,
            found=f"parts {', '.join(of_parts)} in others",
            expected="a number of the specimen in every file, or the tests of one part",
            hint="--specimen-number selects the tests of one part, and applies to files without such a column",
        )
    texts = {listed_in: f"# a campaign of each part: bushfit batch {listed_in}\n"}
    for number, (part, tests) in enumerate(of_parts.items(), start=1):
        file = f"{folder_name(part)}.toml"
        file = f"{number}_{file}" if file.casefold() in map(str.casefold, texts) else file
        texts[file] = campaign_text(f"{name} {part}", bushing, tests, folder)
        entry = key_lines({"campaign": file, "name": f"{name} {part}"})
        texts[listed_in] += "\n".join(["", "[[bushings]]", *entry, ""])
    return texts


def with_specimens_named(files: Sequence[Inspection]) -> list[Inspection]:
    """Give different specimens different names: coupon, coupon_2 and so on.

    Args:
        files: inspections.

    Returns:
        The same inspections, renamed where two specimens had one name.
    """
    named, renamed = dict[Specimen, Specimen](), list[Inspection]()
    for inspection in files:
        specimen = inspection.direction
        if isinstance(specimen, Specimen):
            if specimen not in named:
                used = {specimen_named.name for specimen_named in named.values()}
                names = chain([specimen.name], (f"{specimen.name}_{number}" for number in count(2)))
                named[specimen] = replace(specimen, name=next(name for name in names if name not in used))
            body = named[specimen]
            inspection = replace(inspection, direction=body, entry={**inspection.entry, "specimen": body.name})
        renamed.append(inspection)
    return renamed


def key_lines(keys: Mapping[str, Any]) -> list[str]:
    """Keys and their values in TOML, a line each."""
    return [f"{key} = {toml_value(value)}" for key, value in keys.items()]


def campaign_tables(files: Sequence[Inspection], folder: Path | None = None) -> list[str]:
    """Tables of a campaign for its specimens and tests; for a raw history, a comment on what to do first.

    Args:
        files: inspections.
        folder: folder of the campaign; without it, the full paths of files are written.

    Returns:
        Texts in TOML.
    """
    specimens = dict.fromkeys(one.direction for one in files if isinstance(one.direction, Specimen))
    tables = ["\n".join([*specimen_lines(specimen), ""]) for specimen in specimens]
    for inspection in files:
        name, place = inspection.file.resolve().as_posix(), inspection.direction
        with suppress(ValueError):  # another drive, where no path leads
            name = Path(os.path.relpath(inspection.file, folder)).as_posix() if folder else name
        if inspection.kind == "history":
            file_name = printable(name)
            typed = f'"{file_name}"' if " " in file_name else file_name
            command = f"bushfit reduce {typed} --direction {place or '...'}"
            tables.append(f"# {file_name} is a raw history: {command} converts it to a sweep\n")
            continue
        lines = [f"[[{_TABLES[inspection.kind]}]]", f"file = {toml_value(name)}"]
        if not isinstance(place, Specimen):
            direction = f'"{place}"' if place else '"..."  # axial or radial: the file does not state it'
            lines.append(f"direction = {direction}")
        tables.append("\n".join([*lines, *key_lines(inspection.entry), ""]))
    return tables


def pasted_text(files: Sequence[Inspection]) -> str:
    """Tables to paste into a campaign in any folder: files are named by their full path."""
    head = "# files with their full path; bushfit init writes paths relative to the campaign\n"
    return head * any(inspection.kind in _TABLES for inspection in files) + "\n".join(campaign_tables(files))
