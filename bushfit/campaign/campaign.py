"""A campaign: a bushing, specimens of its compound, their tests and settings, read from a TOML file."""

import hashlib
import os
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from bushfit.campaign.bodies import specimens_of
from bushfit.campaign.copies import without_copied_loops, without_copied_points
from bushfit.campaign.quantities import Compound, EffectsSettings, ReportSettings, embed_logo
from bushfit.campaign.schema import CampaignFile, FitSettings, ParameterSetting, PredictSettings, RigSettings
from bushfit.campaign.simulated import SimulateSettings
from bushfit.campaign.strain import with_strain_checked
from bushfit.campaign.toml import parse_toml
from bushfit.caveat import join_names
from bushfit.effects import effect_name_of, place_suffix, with_base
from bushfit.errors import CampaignError, error_location, quote_path
from bushfit.geometry import Bushing, Direction, Place, Specimen, get_places
from bushfit.model.laws import register_file
from bushfit.model.model import FIVE, Model
from bushfit.model.transfer import FACTOR_SPREAD
from bushfit.progress import track
from bushfit.reading.finding import direction_of_table, find_table
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS, ZERO_TO_PEAK, split_convention
from bushfit.reading.instruments import RECORDINGS
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import AnyTest, Loop, Sweep
from bushfit.reading.preload import Preload
from bushfit.reading.stated import LoopFile, SweepFile, place_tested
from bushfit.reading.sweeps import read_sweep
from bushfit.reduction.displacement import prepare_record
from bushfit.reduction.programme import split_record
from bushfit.units import CELSIUS, parse_quantity
from bushfit.validation import validate_tables

#: Endings of texts and workbooks.
_TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm", ".xls", ".xlsx", ".xlsm", ".xlsb", ".ods")
#: Endings of test files, from which `bushfit init` writes a campaign.
TEST_FILES = (*_TABLES, ".gz", *RECORDINGS)
#: Line of a TOML file that begins a table of tests.
_LISTS_TESTS = re.compile(rb"^\s*\[\[?(?:loops|sweeps|simulate)\]", re.MULTILINE)


@dataclass(frozen=True, eq=False, repr=False)
class Campaign:
    """A bushing, specimens of its compound, their tests, and the settings of the campaign file, all in SI.

    Args:
        name: name of the campaign; default the name of the bushing, of several bushings, or of the first specimen.
        path: path of the campaign file.
        sha256: SHA-256 of the campaign file; empty without a file.
        logo: logo of [report] as a data URI; None without a logo.
        bushing: the bushing; None if only specimens, or several bushings, were tested.
        loops, sweeps: measured tests.
        validation: records that are compared with the model and never fitted.
        specimens: specimens, and the directions of each of several bushings.
        fit, predict, rig, report, effects: settings of the table of this name.
        simulate, compound: settings of the table of this name; None if the file lacks the table.
    """

    name: str
    path: Path
    bushing: Bushing | None
    loops: tuple[Loop, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    validation: tuple[Loop, ...] = ()
    fit: FitSettings = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: SimulateSettings | None = None
    specimens: tuple[Specimen, ...] = ()
    rig: RigSettings = field(default_factory=RigSettings)
    compound: Compound | None = None
    sha256: str = ""
    report: ReportSettings = field(default_factory=ReportSettings)
    logo: str | None = None
    effects: EffectsSettings | None = None

    def __repr__(self) -> str:
        kinds = {"loop": len(self.loops), "sweep": len(self.sweeps)}
        counts = (f"{count} {kind}{'s' * (count != 1)}" for kind, count in kinds.items())
        return f"Campaign {self.name}: {', '.join(counts)}"


def load_campaign(path: str | Path) -> Campaign:
    """Read a campaign file and the test files that it lists.

    Args:
        path: TOML file of the campaign.

    Returns:
        Campaign in SI; a record of several loops is split, and copies of a test are left out.

    Raises:
        CampaignError: the file is missing, not TOML, or has invalid keys or values.
        UnitError: a quantity without a unit, or with an incompatible unit.
        ModelError: impossible dimensions of the bushing.
        MeasurementError: a test file that cannot be used.
    """
    path = Path(path)
    refuse_tests([path])
    content = _read_file(path)
    if not (content.loops or content.sweeps or content.simulate or content.compound):
        raise CampaignError(
            "the campaign has no tests",
            expected="[[loops]] or [[sweeps]] tables, or a [simulate] or a [compound] table",
            hint='add [[loops]] with file = "..." and direction = "axial"',
            file=path,
        )
    with error_location(path):
        bushing = content.bushing.to_bushing() if content.bushing else None
        specimens = tuple(specimens_of(content.bushings, content.specimens))
        _check_bodies(content)
        _check_places(content, specimens)
    with error_location(place="[report] logo"):
        logo = embed_logo(path.parent / content.report.logo) if content.report.logo else None
    names = iter(_test_names([*content.loops, *content.sweeps, *content.validation]))

    def read(reader: Callable[..., Any], kind: str, tests: Sequence[Any]) -> Iterator[tuple[Any, Any]]:
        """Read the tests of a list of the campaign.

        Args:
            reader: `read_loop` or `read_sweep`.
            kind: name of the list, such as "loops".
            tests: tables of the list.

        Yields:
            Each test, and its table.
        """
        arguments = reader_keywords(path, tests, [*islice(names, len(tests))], specimens)
        for number, _ in enumerate(track(f"{kind} read", tests), start=1):
            with error_location(default_place=f"[[{kind}]] #{number} of {path}"):
                keywords = next(arguments)
                measured = reader(**keywords)
            yield measured, keywords["test"]

    check = partial(with_strain_checked, bushing=bushing)
    all_loops = [check(loop) for record in read(read_loop, "loops", content.loops) for loop in split_record(*record)]
    all_sweeps = [check(sweep) for sweep, _ in read(read_sweep, "sweeps", content.sweeps)]
    records = read(read_loop, "validation", content.validation)
    tests: list[Loop | Sweep] = [*all_loops, *all_sweeps]
    units = {test.direction: test.preload.unit for test in tests if test.preload and test.preload.value}
    several = join_names(table.name for table in content.bushings)
    contents: dict[str, Any] = {
        "name": content.name or (bushing.name if bushing else several or specimens[0].body),
        "bushing": bushing,
        "specimens": specimens,
        "loops": with_unit_of_zero(without_copied_loops(all_loops), units),
        "sweeps": with_unit_of_zero(without_copied_points(all_sweeps), units),
        "validation": tuple(prepare_record(record, test.lowpass) for record, test in records),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "logo": logo,
    }
    factors = tuple(f"stiffness_factor.{table.name}" for table in content.bushings if table.factor == "free")
    parameters = {**{name: ParameterSetting() for name in factors}, **content.fit.parameters}
    for name in factors:
        if (setting := parameters[name]).vary and not (setting.prior or setting.tie):
            parameters[name] = replace(setting, prior=f"1 +- {FACTOR_SPREAD}")
    effects = (*content.fit.effects, *(name for name in factors if name not in content.fit.effects))
    contents["fit"] = replace(content.fit, effects=effects, parameters=parameters)
    settings = {key: value for key, value in vars(content).items() if key != "bushings"}
    return Campaign(**{**settings, **contents}, path=path)


def _read_file(path: Path) -> CampaignFile:
    """Read a campaign file; the effect of [effects] is registered first, since other tables may name its parameters."""
    tables = parse_toml(path)
    match tables.get("effects"):
        case {"file": str(law)}:
            with error_location(path, place="[effects]"):
                register_file(Path(os.path.normpath(path.parent / law)))
    match tables:
        case {"bushings": [{"campaign": _}, *_]}:
            hint = f"to evaluate the list: bushfit batch {quote_path(path)}"
            raise CampaignError("a campaign is needed", file=path, found="a list of campaigns", hint=hint)
    return validate_tables(tables, path, CampaignFile)


def load_bushing(path: Path) -> Bushing:
    """Read the bushing of a campaign file, or of a file with only a [bushing] table, without reading the tests.

    Raises:
        CampaignError: the file is missing, not TOML, or has no [bushing].
        ModelError: impossible dimensions of the bushing.
    """
    table = _read_file(path).bushing
    if table is None:
        expected = "a [bushing] table with name, inner_radius, outer_radius and length"
        raise CampaignError("the file has no [bushing] table", file=path, expected=expected)
    with error_location(path):
        return table.to_bushing()


def _check_bodies(content: CampaignFile) -> None:
    """Raise a CampaignError for missing or repeated bodies, [bushing] and [[bushings]], or bushings without tests."""
    names = [*(table.name for table in content.bushings), *(table.name for table in content.specimens)]
    if not (content.bushing or names):
        expected = "[bushing] with its name, radii and length, [[bushings]] or [[specimens]]"
        raise CampaignError("the campaign does not state what was tested", expected=expected)
    if content.bushing and content.bushings:
        expected = "[bushing] for one bushing, or [[bushings]] for several of one compound"
        raise CampaignError("two lists of bushings", found="[bushing] and [[bushings]]", expected=expected)
    all_names = [*names, *(f"{table.name} {axis}" for table in content.bushings for axis in Direction)]
    if doubles := {name for name in all_names if all_names.count(name) > 1}:
        table = "[[bushings]]" if content.bushings else "[[specimens]]"
        raise CampaignError("two bodies have one name", place=table, found=", ".join(sorted(doubles)))
    tested = {test.bushing or test.specimen for test in (*content.loops, *content.sweeps)}
    untested = [table.name for table in content.bushings if table.name not in tested]
    if tested and untested and tested <= {*names}:  # a test of no body is refused where it is read
        expected = f'a test with bushing = "{untested[0]}"'
        hint = "bushfit predict --bushing FILE predicts a bushing that was not tested from its [bushing] in a file"
        raise CampaignError("a bushing has no tests", found=untested[0], expected=expected, hint=hint)


def _check_places(content: CampaignFile, specimens: Sequence[Specimen]) -> None:
    """Raise a CampaignError for unknown directions or specimens in [predict], [report], [fit] and [simulate]."""
    with error_location(place="predict.directions"):
        for name in content.predict.directions or ():
            get_places(name, specimens)
    with error_location(place="report.operating_points"):
        for point in content.report.operating_points:
            get_places(point.place, specimens)
    simulated = content.simulate.effect_parameters if content.simulate else {}
    for name in (*content.fit.effects, *content.fit.parameters, *simulated):
        if place := place_suffix(name):
            with error_location(place=name):
                get_places(place, specimens)


def model_of(campaign: Campaign) -> Model:
    """Build the model that a campaign's [simulate] table describes.

    Args:
        campaign: campaign with a [simulate] table.

    Returns:
        Model with the parameters and effects of the [simulate] table.

    Raises:
        CampaignError: no [simulate] table, or no value of mu, m, alpha, sigma_fmax or eps_half.
        ModelError: an unknown effect or an impossible value.
    """
    if campaign.simulate is None:
        raise CampaignError(
            "the campaign does not state what to simulate",
            expected="a [simulate] table that states the material parameters",
            hint="or fit the campaign first and simulate its model.json",
            file=campaign.path,
        )
    values = campaign.simulate.parameters
    missing = [name for name in FIVE if name not in values]
    if missing:
        raise CampaignError(
            "parameters without a value",
            file=campaign.path,
            place="[simulate.parameters]",
            found="no " + ", ".join(missing),
            expected="all of " + ", ".join(FIVE),
        )
    with error_location(campaign.path):
        names = with_base(dict.fromkeys(map(effect_name_of, campaign.simulate.effect_parameters)))
        used = {name: value for name, value in values.items() if effect_name_of(name) in names}
        return Model(campaign.bushing, names, {**used, **campaign.simulate.effect_parameters})


def campaigns_in(folder: Path) -> list[Path]:
    """Return the campaigns of a folder in order: its TOML files that list tests."""
    return [path for path in sorted(folder.glob("*.toml")) if _LISTS_TESTS.search(path.read_bytes())]


def refuse_tests(paths: Sequence[Path]) -> None:
    """Raise a CampaignError if the paths are test files, a folder or a model file instead of a campaign."""
    model = paths[0]
    try:
        tests = [path for path in paths if path.is_dir() or (path.suffix.lower() in TEST_FILES and path.exists())]
        campaigns = [quote_path(path) for folder in tests for path in campaigns_in(folder)]
        if not tests and not (model.suffix.lower() == ".json" and model.exists()):
            return
    except OSError:  # a locked folder, or a name that is too long: the reader reports it
        return
    found, hint = "a model", f"to predict from a model: bushfit predict {quote_path(model)}"
    if tests:
        found = "a folder" if tests[0].is_dir() else "a test file" if len(tests) == 1 else "test files"
        sizes = '--inner-radius "10 mm" --outer-radius "18 mm" --length "34 mm"'
        hint = (
            f"to write one, with the dimensions of your rubber: bushfit init {' '.join(map(quote_path, tests))} {sizes}"
        )
    if campaigns:
        hint = f"give the campaign of the folder: {' or '.join(campaigns)}"
    expected = "a .toml file that names the bushing and its tests"
    raise CampaignError("a campaign is needed", file=[*tests, model][0], found=found, expected=expected, hint=hint)


def reader_keywords(
    path: Path, tests: Sequence[LoopFile | SweepFile], names: Sequence[str], specimens: Sequence[Specimen] = ()
) -> Iterator[dict[str, Any]]:
    """Keyword arguments with which `read_loop` or `read_sweep` reads the tests of a campaign.

    Args:
        path: path of the campaign file.
        tests: [[loops]] or [[sweeps]] tables.
        names: name of each test.
        specimens: specimens of the campaign.

    Yields:
        Keyword arguments of the reader for each test, in order.

    Raises:
        CampaignError: a test that is listed twice, or that states no direction or specimen.
    """
    listed_tests = set()
    sources = [
        (os.path.normpath(path.parent / test.file), test.sheet, test.header_line, test.temperature, test.preload)
        for test in tests
    ]
    counts = Counter(sources)
    for test, source, name in zip(tests, sources, names, strict=True):
        if (identity := (*source, test.direction, test.specimen_number, *test.rows.items())) in listed_tests:
            expected = "each file, or each sheet of a file, once"
            raise CampaignError("a file is listed twice", file=path, place=test.file, expected=expected)
        listed_tests.add(identity)
        shared = counts[source] > 1
        keywords: dict[str, Any] = {"file": path.parent / test.file, "test": test, "name": name, "shared": shared}
        if test.direction is None and test.specimen is None:
            names_of = SWEEP_COLUMNS if isinstance(test, SweepFile) else LOOP_COLUMNS
            table = find_table(keywords["file"], names_of, test.columns, test.units, test)
            keywords["test"] = test = replace(test, direction=direction_of_table(table))
        with error_location(path, place=test.file):
            keywords["direction"] = body = place_tested(vars(test), specimens)
            if isinstance(test, SweepFile) and (amplitude := test.at_amplitude):
                quantity, convention = split_convention(amplitude)
                level = parse_quantity(quantity, body.motion.displacement_unit)
                if convention:  # which takes precedence over that of the header
                    level *= ZERO_TO_PEAK[convention] / ZERO_TO_PEAK[test.amplitude or "zero-to-peak"]
                keywords["at_amplitude"] = level
                if level <= 0.0:
                    raise CampaignError("at_amplitude is not positive", found=f'"{amplitude}"', expected="above zero")
        yield keywords


def with_unit_of_zero(tests: Sequence[AnyTest], units: Mapping[Place, str]) -> tuple[AnyTest, ...]:
    """Copies of tests in which a preload of zero ("none") has the unit of the other preloads of its direction.

    Args:
        tests: loops or sweeps.
        units: SI unit of the preloads by direction or specimen, such as "m" or "N".
    """
    return tuple(
        replace(test, preload=Preload(0.0, units.get(test.direction, test.preload.unit)))
        if test.preload and not test.preload.value
        else test
        for test in tests
    )


def _test_names(tests: Sequence[LoopFile | SweepFile]) -> list[str]:
    """Make a unique name for each test of a campaign.

    The name is the stem of the file, or the path as the campaign lists it if two files have the same stem. If one file
    contains several tests, sheet, temperature, direction, specimen number, preload and selected rows are
    added.
    """
    stems, of_file, names = Counter(Path(test.file).stem for test in tests), defaultdict[str, list[Any]](list), []
    for test in tests:
        of_file[test.file].append(test)
    keys = ("direction", "specimen_number", "preload")
    differing = {
        file: [key for key in keys if len({getattr(test, key) for test in listed}) > 1]
        for file, listed in of_file.items()
    }
    for test in tests:
        stem = Path(test.file).stem
        temperature = None if test.temperature is None else f"{test.temperature - CELSIUS:.4g} degC"
        distinguishing = (getattr(test, key) for key in differing[test.file])
        parts = (stem, test.sheet, temperature, *distinguishing, *test.rows.values())
        is_shared = len(of_file[test.file]) > 1
        names.append(" ".join(filter(None, parts)) if is_shared else test.file if stems[stem] > 1 else stem)
    return names
