"""Result of the inspection of a test file, and the text of a campaign for inspected files."""

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from typing_extensions import TypedDict

from bushfit.campaign.toml import specimen_lines, toml_value
from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError, printable
from bushfit.geometry import Place, Specimen
from bushfit.reading.headers import ERRORS
from bushfit.reading.instruments import word_for_part
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.tablefile import folder_name
from bushfit.validation import to_json_data

#: A hysteresis loop, a sweep, or the raw history of a stepped sine.
Kind = Literal["loop", "sweep", "history"]
#: Findings in the content of a file: facts as texts by label, and a warning for each oddity.
Findings = tuple[dict[str, str], list[Caveat]]
#: Name of the array of tables that lists each kind of test in a campaign.
_TABLES = {"loop": "loops", "sweep": "sweeps"}


def format_frequencies(frequencies: Sequence[float] | Array) -> str:
    """Format the number and range of increasing frequencies [Hz]: "16, from 5 to 155 Hz"."""
    low, high = (f"{end:.4g}" for end in (frequencies[0], frequencies[-1]))
    return f"{len(frequencies)}, {f'at {low}' if low == high else f'from {low} to {high}'} Hz"


@dataclass(frozen=True)
class ColumnDescription:
    """A column of a file.

    Args:
        header: text of the header cell.
        role: role of the column, such as force; None if the column is not used.
        unit: unit of the numbers; None if it is not stated.
        low, high: smallest and largest value in this unit; None if the values were not read.
    """

    header: str
    role: str | None
    unit: str | None
    low: float | None = None
    high: float | None = None


class InspectedFile(TypedDict):
    """Result of the inspection of a file or a sheet of a workbook, as JSON.

    Args:
        file: test file, as the user names it.
        sheet: sheet of the workbook; null if the file has only one.
        kind: hysteresis loop, sweep, or raw history of a stepped sine.
        direction: tested direction or specimen; null if neither file nor options state it.
        written: format of the file by label: encoding, delimiter, decimal mark and so on.
        columns: all columns of the file, in order.
        facts: properties of the test as texts, by label, such as frequencies, amplitudes and noise.
        assumed: assumptions, each with the option or key that changes it; null if there are none.
        odd: one sentence for each oddity, such as an outlier or a gap.
    """

    file: str
    sheet: str | int | None
    kind: Kind
    direction: str | None
    written: dict[str, str]
    columns: tuple[ColumnDescription, ...]
    facts: dict[str, str]
    assumed: str | None
    odd: list[str]


class InspectionDocument(TypedDict):
    """Result of the inspection of several test files, as JSON.

    Args:
        files: inspected files that contain a test.
        left_out: one sentence for each file or sheet without a test.
        campaign: text for a campaign file, or a whole campaign file.
    """

    files: list[InspectedFile]
    left_out: list[str]
    campaign: str


@dataclass(frozen=True, eq=False)
class Inspection:
    """Result of the inspection of a usable test file.

    Args:
        file: test file.
        kind: loop, sweep or raw history.
        direction: direction or specimen of the test; None if neither file nor options state it.
        written: format of the file by label, such as "encoding".
        columns: all columns of the file, in order.
        facts: properties of the test as texts, by label, such as "frequencies".
        odd: one warning for each oddity, such as an outlier.
        entry: further keys of the test's table in a campaign, with values as TOML gives them.
        measured: the test in SI.
        amplitude_convention_unknown: True for a sweep that does not state whether its amplitudes are zero-to-peak or
            peak-to-peak.
    """

    file: Path
    kind: Kind
    direction: Place | None
    written: Mapping[str, str]
    columns: tuple[ColumnDescription, ...]
    facts: Mapping[str, str]
    odd: tuple[Caveat, ...]
    entry: Mapping[str, Any] = field(default_factory=dict)
    measured: Loop | Sweep | None = None
    amplitude_convention_unknown: bool = False

    @property
    def label(self) -> str:
        """Name of the file, and its sheet, direction, part, temperature and preload if the file contains several."""
        in_columns = {column.role for column in self.columns}
        direction = self.direction if "direction" in in_columns else None
        part = self.part if "specimen number" in in_columns else None
        added = {word_for_part(self.file): self.entry.get("sheet"), "direction": direction, "part": part}
        several = {column.role for column in self.columns if column.low != column.high}
        added |= {key: self.entry.get(key) for key in ("temperature", "preload") if key in several}
        added |= self.entry.get("rows", {})
        return ", ".join([self.file.name, *(f"{key} {value}" for key, value in added.items() if value)])

    @property
    def part(self) -> str | None:
        """Number of the tested part, from a column, a name or the lines above the table; None if unknown."""
        number: str | None = self.entry.get("specimen_number")
        return number

    @property
    def assumed(self) -> str | None:
        """Assumptions about the file, each with the option or key that changes it; None if nothing was assumed."""
        assumptions = []
        if isinstance(self.direction, Specimen) and self.direction.kind == "modulus":
            is_tension = self.direction.strain == "tension"
            meaning = "the strain of a bar in tension" if is_tension else "the engineering shear strain"
            otherwise = f'strain = "{"engineering" if is_tension else "tension"}" or "tensor" in [[specimens]]'
            assumptions.append(f"the strain is read as {meaning}; otherwise state {otherwise}")
        if self.amplitude_convention_unknown:
            place = "file" if "at_amplitude" in self.entry else "header"
            assumptions.append(
                f"the {place} does not state whether amplitudes are zero-to-peak or peak-to-peak: zero-to-peak is "
                "assumed; if they are peak-to-peak, add --amplitude peak-to-peak"
            )
        return "; ".join(assumptions) or None

    def to_document(self) -> InspectedFile:
        """Document of the inspection for JSON.

        Returns:
            Entries by key, without the measured data.
        """
        return {
            "file": str(self.file),
            "sheet": self.entry.get("sheet"),
            "kind": self.kind,
            "direction": str(self.direction) if self.direction else None,
            "written": dict(self.written),
            "columns": to_json_data(self.columns, tuple[ColumnDescription, ...]),
            "facts": dict(self.facts),
            "assumed": self.assumed,
            "odd": [warning.text for warning in self.odd],
        }


def campaign_text(name: str, bushing: Mapping[str, str] | None, files: Sequence[Inspection], folder: Path) -> str:
    """Text of a whole campaign file.

    Args:
        name: name of the campaign and of its bushing.
        bushing: other keys of [bushing], quantities as texts; None if only specimens were tested.
        files: inspections of the tests.
        folder: folder of the campaign, to which the paths of files are relative.
    """
    head = [*(["[bushing]"] if bushing else []), *key_lines({"name": name, **(bushing or {})}), ""]
    tests = [inspection for kind in _TABLES for inspection in files if inspection.kind == kind]
    report = "# [report] fills the head of the report: "
    report += 'customer = "...", part_number = "...", drawing, laboratory, date, logo, operating_points\n'
    return "\n".join([*head, *campaign_tables(tests, folder), report])


def campaigns_of_parts(
    name: str, bushing: Mapping[str, str] | None, files: Sequence[Inspection], folder: Path, listed_in: str
) -> dict[str, str]:
    """Texts of one campaign file for each part, and of the batch manifest that lists the campaigns.

    Args:
        name: name of the bushing.
        bushing: other keys of [bushing], quantities as texts; None if only specimens were tested.
        files: inspections of the tests, each with a part number.
        folder: folder of the campaigns.
        listed_in: file name of the manifest.

    Returns:
        The texts by file name, the manifest first.

    Raises:
        CampaignError: a test without a part number.
    """
    of_parts = dict[str, list[Inspection]]()
    for inspection in files:
        of_parts.setdefault(inspection.part or "", []).append(inspection)
    if unknown := of_parts.pop("", []):
        found = f"specimens {', '.join(of_parts)} in other files"
        raise CampaignError(**ERRORS["no_specimen_number"], file=unknown[0].file, found=found)
    texts = {listed_in: f"# a campaign of each part: bushfit batch {listed_in}\n{''.join(key_lines({'name': name}))}\n"}
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
        files: inspections of the tests.

    Returns:
        The same inspections; different specimens no longer share a name.
    """
    named, renamed = dict[Specimen, Specimen](), list[Inspection]()
    for inspection in files:
        if isinstance(specimen := inspection.direction, Specimen):
            number = sum(other.name == specimen.name for other in named) + 1
            body = replace(specimen, name=f"{specimen.name}_{number}" if number > 1 else specimen.name)
            body = named.setdefault(specimen, body)
            inspection = replace(inspection, direction=body, entry={**inspection.entry, "specimen": body.name})
        renamed.append(inspection)
    return renamed


def key_lines(keys: Mapping[str, Any]) -> list[str]:
    """Lines of TOML, one for each key with its value."""
    return [f"{key} = {toml_value(value)}" for key, value in keys.items()]


def campaign_tables(files: Sequence[Inspection], folder: Path | None = None) -> list[str]:
    """Campaign tables for specimens and tests; for a raw history, a comment with the command that reduces it.

    Args:
        files: inspections of the tests.
        folder: folder of the campaign, to which the paths of files are relative; None for full paths.

    Returns:
        TOML text of each table.
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
            tables.append(f"# {file_name} is a raw history. To convert it to a sweep: {command}\n")
            continue
        lines = [f"[[{_TABLES[inspection.kind]}]]", f"file = {toml_value(name)}"]
        if not isinstance(place, Specimen):
            direction = f'"{place}"' if place else '"..."  # axial or radial: the file does not state it'
            lines.append(f"direction = {direction}")
        tables.append("\n".join([*lines, *key_lines(inspection.entry), ""]))
    return tables


def pasted_text(files: Sequence[Inspection]) -> str:
    """TOML tables of the tests, to paste into a campaign in any folder: files have their full path."""
    head = "# files with their full path; bushfit init writes paths relative to the campaign\n"
    return head * any(inspection.kind in _TABLES for inspection in files) + "\n".join(campaign_tables(files))
