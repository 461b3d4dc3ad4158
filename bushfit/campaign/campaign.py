"""A campaign: one bushing, its tests and settings, read from a TOML file and the measurements that it names."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from bushfit.campaign.naming import folder_name
from bushfit.campaign.schema import CampaignFile, FitSettings, LoopFile, PredictSettings, SimulateSettings, SweepFile
from bushfit.campaign.toml import read_toml
from bushfit.errors import CampaignError, naming, typed
from bushfit.geometry import Bushing
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.sweeps import read_sweep
from bushfit.reduction.programme import read_programme

#: Endings of test files, which `bushfit init` makes a campaign of.
TEST_FILES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".xls", ".xlsx", ".xlsm", ".xlsb", ".ods")


@dataclass(frozen=True, eq=False)
class Campaign:
    """One bushing, its tests in SI, and the settings of what to do with them.

    Args:
        name: of the campaign; default the name of the bushing.
        path: the campaign file.
        bushing: geometry [m].
        loops, sweeps: the measurements, SI.
        fit, predict: settings, SI; their defaults where the file has none.
        simulate: settings, SI; None where the file has none.
    """

    name: str
    path: Path
    bushing: Bushing
    loops: tuple[Loop, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    fit: FitSettings = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: SimulateSettings | None = None

    @property
    def slug(self) -> str:
        """The name of the campaign's folder of results."""
        return folder_name(self.name)


def load_campaign(path: str | Path) -> Campaign:
    """Read a campaign file and the measurements that it names, each once; a record of several loops gives each.

    Raises:
        CampaignError: the file is missing, no TOML, or has keys or values that are not understood.
        UnitError: a quantity without a unit, or with one that does not fit.
        ModelError: an impossible bushing.
        MeasurementError: a measurement that cannot be used.
    """
    path = Path(path)
    _refuse_tests(path)
    content = read_toml(path, CampaignFile)
    if not (content.loops or content.sweeps or content.simulate):
        raise CampaignError(
            "the campaign has no tests",
            file=path,
            expected="[[loops]] or [[sweeps]] tables, or a [simulate] table",
            hint='add [[loops]] with file = "..." and direction = "axial"',
        )
    with naming(path):
        bushing = Bushing(**vars(content.bushing))
    return Campaign(
        content.name or bushing.name,
        path,
        bushing,
        tuple(loop for keywords in reader_keywords(path, content.loops) for loop in read_programme(**keywords)),
        tuple(read_sweep(**keywords) for keywords in reader_keywords(path, content.sweeps)),
        content.fit,
        content.predict,
        content.simulate,
    )


def _refuse_tests(path: Path) -> None:
    """Raise a CampaignError where a test file, a folder or a model was given in place of a campaign."""
    ending, is_folder = path.suffix.lower(), path.is_dir()
    if not (is_folder or (ending in (*TEST_FILES, ".json") and path.exists())):
        return
    files = f"{typed(path)}/*.csv" if is_folder else typed(path)
    found = "a folder" if is_folder else "a test file"
    hint = (
        f'bushfit init {files} --inner-radius "10 mm" --outer-radius "18 mm" --length "34 mm" makes one, with '
        "the sizes of your rubber"
    )
    if ending == ".json" and not is_folder:
        found, hint = "a model", f"bushfit predict {files} predicts from a model"
    expected = "a .toml file that names the bushing and its tests"
    raise CampaignError("a campaign is needed", file=path, found=found, expected=expected, hint=hint)


def reader_keywords(campaign: Path, tests: Sequence[LoopFile | SweepFile]) -> Iterator[dict[str, Any]]:
    """The keywords of `read_loop` or `read_sweep` for each file of a campaign.

    A test is named by the stem of its file; where two files have one stem, by the file as the campaign lists it.

    Raises:
        CampaignError: a file that is listed twice.
    """
    stems = [Path(test.file).stem for test in tests]
    seen = set()
    for test, stem in zip(tests, stems, strict=True):
        file = campaign.parent / test.file
        if (place := os.path.normpath(file)) in seen:
            raise CampaignError("a file is listed twice", file=campaign, found=test.file, expected="each file once")
        seen.add(place)
        stated = {key: value for key, value in vars(test).items() if value is not None}
        written = FileFormat(**{entry.name: stated.pop(entry.name, None) for entry in fields(FileFormat)})
        name = stem if stems.count(stem) == 1 else test.file
        yield {**stated, "file": file, "name": name, "listed_as": Path(test.file), "written": written}
