"""Origin of a result as stated in result files: the campaign, its tests, the command, and the files that were read."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bushfit.campaign.campaign import Campaign
from bushfit.caveat import to_entries
from bushfit.errors import quote_path
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.model.file import to_document
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.grid import measured_levels
from bushfit.reading.measurement import Loop, Sweep


def result_document(result: Result, campaign: Mapping[str, Any]) -> dict[str, Any]:
    """Content of a model file: the result, its warnings, and the description of its campaign (`campaign_document`)."""
    return {**to_document(result), **to_entries(warnings_of(result)), "campaign": campaign}


def campaign_document(data: PreparedCampaign, command: str, options: Iterable[str] = ()) -> dict[str, Any]:
    """Description of a campaign for result files, with its tests and the command that reproduces the numbers.

    Args:
        data: the campaign, prepared for a fit.
        command: name of the command.
        options: words of the command-line options that change the numbers.

    Returns:
        JSON data of the campaign: name, file, hash, command, tests and report head.
    """
    campaign = data.campaign
    loss = () if campaign.fit.loss == "linear" else ("--loss", campaign.fit.loss)
    return {
        "name": campaign.name,
        "file": campaign.path.name,
        "sha256": campaign.sha256,
        "command": command_line(command, campaign.path.name, *options, *loss),
        "tests": [_test_document(data_set) for data_set in data.data_sets],
        "report": campaign.report.lines,
        "logo": campaign.logo,
    }


def command_line(command: str, *words: str) -> str:
    """Command line of bushfit for a terminal, with quotes where necessary."""
    return " ".join(["bushfit", command, *(quote_path(Path(word)) for word in words)])


def option_words(**options: str | bool | Iterable[str] | None) -> list[str]:
    """Format options as words of a command line.

    Args:
        options: value of each option by its key: a text, several texts, or True for a flag; None to leave it out.

    Returns:
        Words such as ["--effect", "inertia", "--profile"].
    """
    words = list[str]()
    for key, value in options.items():
        name = "--" + key.replace("_", "-")
        if isinstance(value, bool | None):
            words += [name] if value else []
        else:
            words += [word for text in ([value] if isinstance(value, str) else value) for word in (name, text)]
    return words


def input_files(campaign: Campaign | None, *others: Path | None) -> list[Path]:
    """Files that a command has read.

    Args:
        campaign: campaign; None without one.
        others: other files; None for those that were not given.

    Returns:
        Campaign file, its test files and logo, and the other files.
    """
    files = [file for file in others if file]
    if campaign is None:
        return files
    folder, logo = campaign.path.parent, campaign.report.logo
    tests: tuple[Loop | Sweep, ...] = (*campaign.loops, *campaign.sweeps, *campaign.validation)
    names = [test.source.file for test in tests if test.source] + ([logo] if logo else [])
    return [campaign.path, *(folder / name for name in names), *files]


def _test_document(data_set: MeasuredTest) -> dict[str, Any]:
    """Description of a test for result files: direction or specimen, ranges [SI], file, and stated conditions."""
    source, sweep = data_set.test.source, data_set.test if isinstance(data_set, MeasuredSweep) else None
    return {
        "test": data_set.name,
        "kind": data_set.kind,
        "place": str(data_set.direction),
        "stepped": sweep and sweep.stepped,
        "frequency_Hz": [float(data_set.frequency.min()), float(data_set.frequency.max())],
        "amplitude": [float(data_set.amplitude.min()), float(data_set.amplitude.max())],
        "frequencies_Hz": measured_levels([sweep], "frequency").tolist() if sweep else [],
        "amplitudes": measured_levels([sweep], "amplitude").tolist() if sweep else [],
        "unit": data_set.direction.motion.displacement_unit,
        "repeats": int(sweep.repeat.max()) if sweep else 1,
        "rows": data_set.size // data_set.residuals_per_point,
        "file": source and str(source.file),
        "sha256": source and source.sha256,
        "conditions": dict(source.conditions) if source else {},
    }
