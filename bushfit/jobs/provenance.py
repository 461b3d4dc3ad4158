"""What a result says of its campaign: which file, which tests under which conditions, and the command that made it."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bushfit.errors import typed
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import DataSet, SweepData
from bushfit.jobs.grid import measured_levels
from bushfit.model.file import to_document
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of


def document_of(result: Result, campaign: Mapping[str, Any]) -> dict[str, Any]:
    """The JSON document of a result, with all its warnings, and the campaign that it comes from."""
    return {**to_document(result), "warnings": warnings_of(result), "campaign": campaign}


def campaign_document(data: Data, command: str, options: Iterable[str] = ()) -> dict[str, Any]:
    """The campaign as JSON-ready data: its name, file and tests, and the command with all that settles its numbers."""
    campaign = data.campaign
    loss = () if campaign.fit.loss == "linear" else ("--loss", campaign.fit.loss)
    return {
        "name": campaign.name,
        "file": campaign.path.name,
        "sha256": campaign.sha256,
        "command": command_line(command, campaign.path.name, *options, *loss),
        "tests": [_test(data_set) for data_set in data.data_sets],
        "report": campaign.report.lines,
        "logo": campaign.logo,
    }


def command_line(command: str, *words: str) -> str:
    """A command of bushfit as it is typed into a terminal."""
    return " ".join(["bushfit", command, *(typed(Path(word)) for word in words)])


def options_typed(**options: str | bool | Iterable[str] | None) -> tuple[str, ...]:
    """The words of options by their keys: a value, each of several, or a flag that is set; none of None."""
    words = list[str]()
    for key, value in options.items():
        name = "--" + key.replace("_", "-")
        if isinstance(value, bool | None):
            words += [name] if value else []
        else:
            words += [word for each in ([value] if isinstance(value, str) else value) for word in (name, each)]
    return tuple(words)


def _test(data_set: DataSet) -> dict[str, Any]:
    """A test: what it was made on, its range [SI], and its file with the conditions that the campaign states."""
    source, sweep = data_set.test.source, data_set.sweep if isinstance(data_set, SweepData) else None
    return {
        "test": data_set.name,
        "kind": data_set.kind,
        "place": str(data_set.direction),
        "stepped": sweep and sweep.stepped,
        "frequency_Hz": _ends(data_set.frequency),
        "amplitude": _ends(data_set.amplitude),
        "frequencies_Hz": measured_levels([sweep], "frequency").tolist() if sweep else [],
        "amplitudes": measured_levels([sweep], "amplitude").tolist() if sweep else [],
        "unit": data_set.direction.motion.displacement_unit,
        "repeats": int(sweep.repeat.max()) if sweep else 1,
        "rows": data_set.size // data_set.parts,
        "file": source and str(source.file),
        "sha256": source and source.sha256,
        "conditions": dict(source.conditions) if source else {},
    }


def _ends(values: Any) -> list[float]:
    return [float(values.min()), float(values.max())]
