"""`bushfit init`: test files and a geometry -> a campaign; at a terminal it asks for missing options."""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from bushfit.caveat import Caveat
from bushfit.cli.file_options import QUESTIONS, STATED, direction_error, metadata_options, options_named, value_type
from bushfit.cli.options import command_called, flag, option, option_group, option_name
from bushfit.cli.output import Output, with_output
from bushfit.errors import BushfitError, CampaignError, MeasurementError, NoTestError, error_location, quote_path
from bushfit.progress import track
from bushfit.report.results import ResultFile, check_free
from bushfit.units import parse_quantity

if TYPE_CHECKING:
    from bushfit.geometry import Bushing
    from bushfit.inspection.gathering import TestSource
    from bushfit.inspection.record import Inspection, InspectionDocument

#: Sides of the rubber with a radius or diameter option.
_SIDES = ("inner", "outer")
#: Pattern of an option in the hint of an error, with the role of a column if it has one.
_NAMED = re.compile(r'--(?:(column|unit) "?(\w+)=|([a-z][a-z-]+))')
#: Key of an option, and the role for columns and units ("" for other options).
_Key = tuple[str, str]
#: Options that are requested once for all files, with their default answers.
_ONCE: dict[_Key, str] = {("amplitude", ""): "zero-to-peak", ("preload", ""): ""}
_Read = TypeVar("_Read")


@command_called(
    "init",
    "data/arm_bushing/loop_axial_1.csv data/arm_bushing/sweep_axial.csv "
    '--inner-diameter "28 mm" --outer-diameter "40 mm" --length "45 mm"',
)
@option_group(
    "The rubber of the bushing",
    option("--inner-radius LENGTH"),
    option("--inner-diameter LENGTH", 'Radius or diameter where the rubber meets the inner sleeve, such as "20 mm".'),
    option("--outer-radius LENGTH"),
    option("--outer-diameter LENGTH", 'Radius or diameter where the rubber meets the outer sleeve, such as "36 mm".'),
    option("--length LENGTH", 'Length of the rubber along the axis, such as "34 mm" (mean of inner and outer length).'),
    option("--name NAME", "Name of the bushing [folder of the first file]."),
)
@metadata_options()
@option_group("Output", flag("--no-input", "Ask no questions; report missing information as an error."))
@with_output("results/<bushing name>", target="Write to this folder, or to this TOML file")
def command(files: tuple[Path, ...], name: str | None, no_input: bool, output: Output, **sizes: Any) -> None:
    """Write a campaign from test files and the geometry of the bushing.

    A campaign is a text file of a bushing and its tests. FILE is a test file, a workbook or a folder. In a terminal,
    init asks for missing information. An option applies to all files. Writes campaign.toml, or the file given by -o;
    for several parts, a campaign each and batch.toml. For several bushings of one compound, give the files of one, and
    add the others under [[bushings]].
    """
    from bushfit.campaign.strain import implausible_strain
    from bushfit.geometry import Specimen
    from bushfit.inspection.gathering import gather, with_contradictions
    from bushfit.inspection.record import campaign_text, campaigns_of_parts, with_specimens_named

    test_options: Mapping[str, Any] = sizes.pop("test_options")
    at_terminal = sys.stdin is not None and sys.stdin.isatty()
    questions = Questions(at_terminal and not (no_input or output.quiet or output.as_json))
    usual = (files[0].resolve() if files[0].is_dir() else files[0].resolve().parent).name
    if name is None and questions.enabled and not any(sizes.values()):
        name = click.prompt("name of the bushing", default=usual, err=True)
    name = name or usual
    file = output.output if output.output and output.output.suffix == ".toml" else None
    folder, target = (file.parent, file.name) if file else (output.folder(name), "campaign.toml")
    size = partial(make_bushing, name)
    bushing = questions.complete(sizes, size) if any(sizes.values()) else None
    sources, left_out = gather(files, test_options)
    check_free(folder, [target], overwrite=output.force)
    inspections, histories = inspect_sources(sources, questions, is_sized=bushing is not None)
    inspections, left_out = with_contradictions(with_specimens_named(inspections)), [*left_out, *histories]
    if bushing is None and not all(isinstance(inspection.direction, Specimen) for inspection in inspections):
        bushing = questions.complete(sizes, size)
    table = bushing and bushing[1]
    if len({inspection.part for inspection in inspections if inspection.part}) > 1:
        target = target if file else "batch.toml"
        written = campaigns_of_parts(name, table, inspections, folder, target)
    else:
        written = {target: campaign_text(name, table, inspections, folder)}
    if bushing:
        body = bushing[0]
        inner, outer, long = (1e3 * size for size in (2 * body.inner_radius, 2 * body.outer_radius, body.length))
        across = f"from {inner:.6g} to {outer:.6g} mm in diameter, {(outer - inner) / 2:.6g} mm thick"
        output.print(f"{body.name}: rubber {across}, {long:.6g} mm long")
        if len(written) > 1:
            warning = f"these dimensions were written for all {len(written) - 1} parts, whatever their shape"
            output.warn([Caveat("same_dimensions", warning)])
    wanted = ("programme", "cycles", "frequency", "frequencies", "amplitude", "amplitudes")
    for inspection in inspections:
        facts = [f"{key}: {fact}" for key, fact in inspection.facts.items() if key in wanted or key.startswith("from ")]
        test = inspection.file.parent / inspection.label
        output.print(f"{test}: {inspection.kind}, {inspection.direction}; {'; '.join(facts)}")
        strain = implausible_strain(inspection.measured, bushing[0]) if bushing and inspection.measured else ()
        output.warn(warning.about(inspection.label) for warning in (*inspection.odd, *strain))
    if any(warning.kind == "test_repeat_differs" for inspection in inspections for warning in inspection.odd):
        output.print(
            "several bushings of one compound belong to [[bushings]], each with its sizes: bushfit manual campaign"
        )
    for sentence in dict.fromkeys(inspection.assumed for inspection in inspections if inspection.assumed):
        labels = [inspection.label for inspection in inspections if inspection.assumed == sentence]
        output.print(f"{labels[0] if len(labels) == 1 else f'{len(labels)} tests'}: {sentence}")
    for reason in left_out:
        output.print(f"left out: {reason}")
    document: InspectionDocument = {
        "campaign": written[target],
        "files": [inspection.to_document() for inspection in inspections],
        "left_out": [reason.text for reason in left_out],
    }
    results = [ResultFile(file, "raw", text.encode()) for file, text in written.items()]
    output.write(folder, results, document, files)
    following = f"bushfit {'batch' if len(written) > 1 else 'run'} {quote_path(folder / target)}"
    if any(reason.kind == "to_reduce" for reason in left_out):
        again = "convert the histories as stated above, and give sweep.csv to bushfit init"
        following = f"{again}; or, without these tests: {following}"
    output.print(f"next: {following}")


def make_bushing(name: str, sizes: Mapping[str, str | None]) -> tuple[Bushing, dict[str, str]]:
    """Create the bushing of the new campaign from the options of its size.

    Args:
        name: name of the bushing.
        sizes: texts of the options for radii, diameters and the length, by key.

    Returns:
        The bushing, and the entries of its [bushing] table as texts by key.

    Raises:
        UsageError: both radius and diameter of one side are given.
        CampaignError, UnitError, ModelError: a size is missing or impossible. Errors name the options as given, radius
            or diameter.
    """
    from bushfit.campaign.bodies import BushingSettings
    from bushfit.validation import validate_tables

    texts = {key: text for key, text in sizes.items() if text is not None}
    for key, text in texts.items():
        with error_location(place=option_name(key)):
            parse_quantity(text, "m")
    for side in _SIDES:
        radius, diameter = f"--{side}-radius", f"--{side}-diameter"
        keys_of_side = {f"{side}_radius", f"{side}_diameter"} & texts.keys()
        if len(keys_of_side) > 1:
            raise click.UsageError(f"'{radius}' and '{diameter}' state the same size; give one of them.")
        if not keys_of_side:
            hint = f'state it: {diameter} "20 mm", or {radius} "10 mm"'
            raise CampaignError(f"the {side} size of the rubber is not stated", hint=hint)
    if "length" not in texts:
        raise CampaignError("the length of the rubber is not stated", hint='state it: --length "34 mm"')
    try:
        bushing = validate_tables({"name": name, **texts}, None, BushingSettings).to_bushing()
    except BushfitError as error:
        error.file, error.place = None, error.place and ", ".join(map(option_name, error.place.split(", ")))
        raise
    return bushing, texts | ({"shape": "calibrated"} if bushing.correction is not None else {})


def inspect_sources(
    sources: Sequence[TestSource], questions: Questions, *, is_sized: bool
) -> tuple[list[Inspection], list[Caveat]]:
    """Read loops and sweeps from files, and determine the direction or specimen of each.

    Args:
        sources: files, and sheets of workbooks, with what the user states on their tests.
        questions: asks for missing options at a terminal.
        is_sized: True if sizes of a bushing are given: a file that names a direction is then a test of the bushing, not
            of a block in shear.

    Returns:
        The inspections, and a warning on each file that is left out, such as a raw history in a folder.
    """
    keys = [(source.file.resolve(), str(source.test_options)) for source in sources]
    if twice := [source for source, key in zip(sources, keys, strict=True) if keys.count(key) > 1]:
        raise CampaignError("a file is given twice", found=str(twice[0]), expected="each file once")
    inspections: list[Inspection] = []
    left_out: list[Caveat] = []
    histories: dict[str, list[TestSource]] = defaultdict(list)
    for source in sources if questions.enabled else track("tests looked at", sources):
        look = partial(inspect_source, source, is_sized=is_sized, is_asking=questions.enabled)
        try:
            inspection = questions.complete(source.test_options, look)
        except (click.UsageError, NoTestError) as error:
            if source.is_named:
                raise
            why = error.message if isinstance(error, click.UsageError) else error.problem
            left_out.append(Caveat("left_out", why).about(source))
            continue
        if inspection.kind != "history":
            inspections.append(inspection)
            continue
        direction = str(inspection.direction or "...")
        if source.is_named:
            raise MeasurementError(
                "this is a raw stepped-sine history, not a sweep",
                file=inspection.file,
                expected="hysteresis loops and sweeps",
                hint=f"convert it, and give sweep.csv in its place: {_reduce_command(direction, [source])}",
            )
        histories[direction].append(source)
    for direction, raw in histories.items():
        several = f"{len(raw)} raw stepped-sine histories, {direction}"
        subject, objects = (several, "them") if len(raw) > 1 else (f"{raw[0]}: a raw stepped-sine history", "it")
        sentence = f"{subject}; to convert {objects} to sweep.csv: {_reduce_command(direction, raw)}"
        left_out.append(Caveat("to_reduce", sentence))
    return inspections, left_out


def _reduce_command(direction: str, histories: Sequence[TestSource]) -> str:
    """Command that converts raw histories of one direction to one sweep."""
    return f"bushfit reduce {' '.join(quote_path(source.file) for source in histories)} --direction {direction}"


def inspect_source(
    source: TestSource, test_options: Mapping[str, Any], *, is_sized: bool, is_asking: bool
) -> Inspection:
    """Read one test of the new campaign, with the information that its file and the user state.

    Args:
        source: file or sheet of the test.
        test_options: campaign keys of the test, from the command line and from answers; "" for an empty answer.
        is_sized: True if the diameters or the length of a bushing are given, so that a test is of a bushing.
        is_asking: True at a terminal: a missing optional entry, such as the preload, is also an error.

    Returns:
        The test in SI, with its direction, columns and entries for the campaign.

    Raises:
        BushfitError: an option is missing; the hint names it.
    """
    from bushfit.geometry import Specimen
    from bushfit.inspection.recognition import BLOCK_KEYS

    source = replace(source, test_options={key: value for key, value in test_options.items() if value != ""})
    with options_named():
        inspection = source.inspect()
        if is_sized and isinstance(inspection.direction, Specimen) and inspection.direction.kind == "shear":
            direction = source.without(*BLOCK_KEYS, "direction").inspect().direction
            inspection = source.without(*BLOCK_KEYS).inspect() if direction else inspection
    if not (is_sized or "specimen" not in test_options or isinstance(inspection.direction, Specimen)):
        raise click.UsageError(
            "These are tests of a stiffness: of a specimen in shear, which needs --area and --thickness, or of a "
            "bushing, which needs --inner-radius, --outer-radius and --length."
        )
    if inspection.kind == "history":
        return inspection
    if inspection.direction is None:
        raise direction_error(source.file, source.sheet)
    if is_asking and inspection.amplitude_convention_unknown:
        raise MeasurementError(
            "the file does not state how amplitudes are counted", file=source.file, hint="--amplitude"
        )
    if is_asking and "preload" not in {*inspection.entry, *test_options}:
        raise MeasurementError("the preload of this test is not stated", file=source.file, hint="--preload")
    return inspection


@dataclass(frozen=True)
class Questions:
    """Questions at a terminal for missing options of one command; each answer becomes the next default.

    Args:
        enabled: True if questions are permitted: at a terminal, without --no-input.
    """

    enabled: bool
    _answers: dict[_Key, Any] = field(default_factory=lambda: dict.fromkeys(_ONCE))

    def complete(self, options: Mapping[str, Any], read: Callable[[Mapping[str, Any]], _Read]) -> _Read:
        """Call a function with options; ask for the options that its errors name, until it succeeds.

        Args:
            options: options of the command line.
            read: function that takes the completed options.

        Returns:
            Return value of `read`.
        """
        answers: dict[_Key, Any] = {}
        while True:
            try:
                completed = dict(options)
                for (name, role), answer in answers.items():
                    entry = {f"{name}s": {**completed.get(f"{name}s", {}), role: answer}} if role else {name: answer}
                    completed |= entry
                return read(completed)
            except BushfitError as error:
                if not self.enabled:
                    raise
                named = [(kind or key.replace("-", "_"), role) for kind, role, key in _NAMED.findall(error.hint or "")]
                bare_error = type(error)(**{**vars(error), "hint": None if named else error.hint})
                wanted = [(name, role) for name, role in named if role or name in STATED or name in QUESTIONS]
                wanted.sort(key=lambda key: key[0] == "column")  # which is rarely needed
                new = [key for key in wanted if key not in answers and not options.get(key[0])]
                wrong = [
                    key
                    for key, answer in answers.items()
                    if key in wanted
                    or option_name(key[0]) in (error.place or "")
                    or f'"{answer}"' in error.problem
                    or (error.found or "").strip('"') == str(answer)
                ]
                if not (new or wrong):
                    raise
                for key in [] if new else [*answers][[*answers].index(wrong[0]) :]:  # and the answers after it
                    del answers[key], self._answers[key]
                answers |= self.ask((new or wrong)[0], bare_error)

    def ask(self, key: _Key, error: BushfitError) -> dict[_Key, Any]:
        """Ask at the terminal for the value of an option that an error names; earlier answers are the default.

        Args:
            key: name of the option, and the role of the column if the option is for a column: ("column", "force"), else
                "": ("rate", "").
            error: error to print above the question.

        Returns:
            The answer by `key`; a speed that is answered in Hz has the key of a frequency.
        """
        name, role = key
        answer = self._answers.get(key)
        if key not in _ONCE or answer is None:
            click.echo(f"\n{error}", err=True)
            question = QUESTIONS.get(name, name.replace("_", " ")).format(role=role.replace("_", " "))
            default = _ONCE.get(key, answer)
            answer = click.prompt(
                question, default=default, type=value_type(name), show_default=default != "", err=True
            )
            key = ("frequency", "") if name == "rate" and "Hz" in answer else key
        self._answers[key] = answer
        return {key: answer}
