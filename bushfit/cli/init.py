"""`bushfit init`: test files and a geometry -> a campaign; at a terminal it asks for what neither says."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from bushfit.cli.file_options import STATED, TYPES, direction_error, options_named, with_stated
from bushfit.cli.inspect import tell_left_out
from bushfit.cli.options import command_called, flag, option, option_of, under
from bushfit.cli.output import Output, with_output
from bushfit.errors import BushfitError, CampaignError, MeasurementError, error_location, quote_path
from bushfit.progress import track
from bushfit.report.results import check_free, raw_file
from bushfit.units import parse_quantity

if TYPE_CHECKING:
    from bushfit.geometry import Bushing
    from bushfit.inspection.gathering import Source
    from bushfit.inspection.record import Inspected, InspectionDocument

#: Sides of the rubber whose radius or diameter is asked for.
_SIDES = ("inner", "outer")
#: An option that the hint of an error names, perhaps with the role of a column.
_NAMED = re.compile(r'--(?:(column|unit) "?(\w+)=|([a-z][a-z-]+))')
#: How a question is put, by the key that its answer is of, or else by the key itself.
_WORDS = {
    "column": "header of the column of the {role}",
    "unit": "unit of the {role}",
    "rate": 'rate of the motion, such as "10 mm/min", or its frequency, such as "0.1 Hz"',
    "waveform": "course of the motion in time",
    "amplitude": "they count",
    "at_amplitude": 'its amplitude, such as "0.1 mm"',
    "at_frequency": 'its frequency, such as "10 Hz"',
    "temperature": 'its temperature, such as "23 degC"',
    "preload": 'preload of these tests, such as "500 N axial" or "none"; Enter leaves it open',
    "inner_diameter": 'inner diameter of the rubber, where it meets the inner sleeve, such as "20 mm"',
    "outer_diameter": 'its outer diameter, such as "36 mm"',
    "length": 'its length, the mean of inside and outside, such as "34 mm"',
}
#: The key that an answer is of, and of columns and units the role.
_Key = tuple[str, str]
#: What is asked for once for all files, with what is offered.
_ONCE: dict[_Key, str] = {("amplitude", ""): "zero-to-peak", ("preload", ""): ""}
_Seen = TypeVar("_Seen")


@command_called(
    "init",
    "data/arm_bushing/loop_axial_1.csv data/arm_bushing/sweep_axial.csv "
    '--inner-diameter "28 mm" --outer-diameter "40 mm" --length "45 mm"',
)
@under(
    "The rubber of the bushing",
    option("--inner-radius", "LENGTH"),
    option("--inner-diameter", "LENGTH", 'Inside, one of the two, such as "20 mm".'),
    option("--outer-radius", "LENGTH"),
    option("--outer-diameter", "LENGTH", 'Outside, one of the two, such as "36 mm".'),
    option("--length", "LENGTH", 'Mean of inside and outside, such as "34 mm".'),
    option("--name", "NAME", "Of the bushing [the folder of the first file]."),
)
@with_stated()
@under("Output", flag("--no-input", "Ask nothing, as in a script: say what lacks."))
@with_output("results/<bushing name>")
def command(
    files: tuple[Path, ...],
    name: str | None,
    no_input: bool,
    stated: Mapping[str, Any],
    output: Output,
    **sizes: str | None,
) -> None:
    """Write a campaign from test files and the geometry of the bushing.

    In a terminal it asks for what neither files nor options say. FILE may be a folder, or a workbook with several
    tests; an option holds for all files of its kind. Writes campaign.toml, or -o my_bushing.toml.
    """
    from bushfit.geometry import Specimen
    from bushfit.inspection.record import campaign_text, campaigns_of_parts, with_specimens_named

    questions = Questions.of(output, no_input=no_input)
    usual = (files[0].resolve() if files[0].is_dir() else files[0].resolve().parent).name
    if name is None and questions.asked and not any(sizes.values()):
        name = click.prompt("name of the bushing", default=usual, err=True)
    name = name or usual
    folder, target = output.folder(name), "campaign.toml"
    if output.output and output.output.suffix == ".toml":
        folder, target = output.output.parent, output.output.name
    size = partial(_bushing, name)
    bushing = questions.settled(sizes, size) if any(sizes.values()) else None
    check_free(folder, [target], overwrite=output.force)
    seen, left_out = _usable(files, stated, questions, is_sized=bushing is not None)
    seen = with_specimens_named(seen)
    if bushing is None and not all(isinstance(one.direction, Specimen) for one in seen):
        bushing = questions.settled(sizes, size)
    table = bushing and bushing[1]
    if len({one.part for one in seen if one.part}) > 1:
        target = target if output.output and output.output.suffix == ".toml" else "batch.toml"
        written = campaigns_of_parts(name, table, seen, folder, target)
        check_free(folder, list(written), overwrite=output.force)
    else:
        written = {target: campaign_text(name, table, seen, folder)}
    if bushing:
        _tell_bushing(output, bushing[0])
    for one in seen:
        _tell(output, one)
    tell_left_out(output, left_out)
    document: InspectionDocument = {
        "campaign": written[target],
        "files": [one.to_document() for one in seen],
        "left_out": left_out,
    }
    results = [raw_file(file, text.encode()) for file, text in written.items()]
    output.write(folder, results, document, files)
    output.print(f"next: bushfit {'batch' if len(written) > 1 else 'run'} {quote_path(folder / target)}")


def _radius(side: str, sizes: Mapping[str, str | None]) -> str:
    """A radius as the campaign has it, from the one of the two options that was given."""
    radius, diameter = sizes[f"{side}_radius"], sizes[f"{side}_diameter"]
    options = f"--{side}-radius", f"--{side}-diameter"
    if radius is not None and diameter is not None:
        raise click.UsageError(f"'{options[0]}' and '{options[1]}' are one size; give one of them.")
    if radius is not None:
        return radius
    if diameter is None:
        hint = f'state it: {options[1]} "20 mm", or {options[0]} "10 mm"'
        raise CampaignError(f"the {side} size of the rubber is not stated", hint=hint)
    with error_location(place=options[1]):
        return f"{1e3 * parse_quantity(diameter, 'm') / 2.0:.12g} mm"


def _bushing(name: str, sizes: Mapping[str, str | None]) -> tuple[Bushing, dict[str, str]]:
    """The bushing of the campaign to be, and the keys of its sizes there.

    Errors name the options, diameters where these were given and halved.
    """
    from bushfit.campaign.schema import BushingTable
    from bushfit.validation import validate_tables

    table = {f"{side}_radius": _radius(side, sizes) for side in _SIDES}
    if (length := sizes["length"]) is None:
        raise CampaignError("the length of the rubber is not stated", hint='state it: --length "34 mm"')
    table["length"] = length
    halved = [f"{side}_radius" for side in _SIDES if sizes[f"{side}_diameter"]]
    try:
        bushing = validate_tables({"name": name, **table}, None, BushingTable).to_bushing()
        if bushing.correction is not None:
            table["shape"] = "calibrated"
        return bushing, table
    except BushfitError as error:
        error.file = None
        if error.place:
            keys = error.place.split(", ")
            names = [key.replace("radius", "diameter") if key in halved else key for key in keys]
            error.place = ", ".join(map(option_of, names))
            if set(keys) & set(halved):
                error.hint = "a diameter given counts by its half; check that inner and outer are not swapped"
        raise


def _usable(
    files: Sequence[Path], stated: Mapping[str, Any], questions: Questions, *, is_sized: bool
) -> tuple[list[Inspected], list[str]]:
    """The loops and sweeps among files, each of a known direction or specimen, and why others are left out.

    `is_sized` says whether sizes of a bushing are given: then a file that names a direction is a test of it, and no
    block in shear.
    """
    from bushfit.inspection.gathering import gather

    sources, left_out = gather(files, stated)
    places = [(source.file.resolve(), str(source.stated)) for source in sources]
    if twice := [source for source, place in zip(sources, places, strict=True) if places.count(place) > 1]:
        raise CampaignError("a file is given twice", found=str(twice[0]), expected="each file once")
    seen: list[Inspected] = []
    others = list(left_out)
    for source in sources if questions.asked else track("tests looked at", sources):
        one = questions.settled(source.stated, partial(_look, source, is_sized=is_sized, is_asked=questions.asked))
        if one.kind != "history":
            seen.append(one)
            continue
        hint = f"bushfit reduce {quote_path(one.file)} --direction {one.direction or '...'} makes a sweep.csv of it"
        if source.is_named:
            raise MeasurementError(
                "this is a raw stepped-sine history, not a sweep",
                file=one.file,
                expected="hysteresis loops and sweeps",
                hint=f"{hint}; give that instead",
            )
        others.append(f"{source}: a raw stepped-sine history; {hint}")
    return seen, others


def _look(source: Source, stated: Mapping[str, Any], *, is_sized: bool, is_asked: bool) -> Inspected:
    """A test of which this is stated; where somebody `is_asked`, what it needs not say is asked for as well."""
    from bushfit.geometry import Specimen
    from bushfit.inspection.opening import BLOCK_KEYS

    source = replace(source, stated={key: value for key, value in stated.items() if value != ""})
    with options_named():
        one = source.inspect()
        if is_sized and isinstance(one.direction, Specimen) and one.direction.kind == "shear":
            named = source.without(*BLOCK_KEYS, "direction").inspect().direction
            one = source.without(*BLOCK_KEYS).inspect() if named else one
    if not (is_sized or "specimen" not in stated or isinstance(one.direction, Specimen)):
        raise click.UsageError(
            "These are tests of a stiffness: of a specimen in shear, which needs --area and --thickness, or of a "
            "bushing, which needs --inner-radius, --outer-radius and --length."
        )
    if one.kind != "history" and one.direction is None:
        raise direction_error(source.file, source.sheet)
    if is_asked and one.is_counting_open:
        raise MeasurementError("no header says how amplitudes are counted", file=source.file, hint="--amplitude")
    if is_asked and one.kind != "history" and "preload" not in {*one.entry, *stated}:
        raise MeasurementError("nothing says under which preload this was tested", file=source.file, hint="--preload")
    return one


def _tell_bushing(output: Output, bushing: Bushing) -> None:
    inner, outer, long = (1e3 * size for size in (2 * bushing.inner_radius, 2 * bushing.outer_radius, bushing.length))
    across = f"from {inner:.6g} to {outer:.6g} mm in diameter, {(outer - inner) / 2:.6g} mm thick"
    output.print(f"{bushing.name}: rubber {across}, {long:.6g} mm long")


def _tell(output: Output, seen: Inspected) -> None:
    """One line of what a file is, what was assumed, and what is odd."""
    facts = seen.facts
    wanted = ("programme", "cycles", "frequency", "frequencies", "amplitude", "amplitudes")
    kept = [f"{key}: {value}" for key, value in facts.items() if key in wanted or key.startswith("from ")]
    output.print(f"{seen.file.parent / seen.label}: {seen.kind}, {seen.direction}; {'; '.join(kept)}")
    output.warn([f"{seen.label}: {sentence}" for sentence in seen.odd])
    if seen.assumed:
        output.print(f"  {seen.assumed}")


@dataclass(frozen=True)
class Questions:
    """Questions of one command, where somebody is `asked`; the last answer to one is offered when it comes again."""

    output: Output
    asked: bool
    _answers: dict[_Key, Any] = field(default_factory=lambda: dict.fromkeys(_ONCE))

    @classmethod
    def of(cls, output: Output, *, no_input: bool) -> Questions:
        """Those of a command, none where nobody is there to answer, or wants to be asked."""
        asked = not (no_input or output.quiet or output.as_json) and sys.stdin is not None and sys.stdin.isatty()
        return cls(output, asked)

    def settled(self, stated: Mapping[str, Any], look: Callable[[Mapping[str, Any]], _Seen]) -> _Seen:
        """What comes of what is stated, with answers to what the errors of that ask for."""
        given: dict[_Key, Any] = {}
        while True:
            try:
                every = dict(stated)
                for (name, role), answer in given.items():
                    every |= {f"{name}s": {**every.get(f"{name}s", {}), role: answer}} if role else {name: answer}
                return look(every)
            except BushfitError as error:
                if not self.asked:
                    raise
                told = type(error)(**{**vars(error), "hint": None})
                wanted = _wanted(error)
                new = [key for key in wanted if key not in given and not stated.get(key[0])]
                wrong = [key for key, answer in given.items() if key in wanted or _is_about(told, key, answer)]
                if not (new or wrong):
                    raise
                for key in [] if new else [*given][[*given].index(wrong[0]) :]:  # and what was asked for after it
                    del given[key], self._answers[key]
                given |= self._answer((new or wrong)[0], told)

    def _answer(self, key: _Key, told: BushfitError) -> dict[_Key, Any]:
        name, role = key
        known = self._answers.get(key)
        if key not in _ONCE or known is None:
            self.output.print(f"\n{told}")
            words = _WORDS.get(name, name.replace("_", " ")).format(role=role.replace("_", " "))
            usual = _ONCE.get(key, known)
            known = click.prompt(words, default=usual, type=TYPES.get(name), show_default=usual != "", err=True)
            key = ("frequency", "") if name == "rate" and "Hz" in known else key
        self._answers[key] = known
        return {key: known}


def _wanted(error: BushfitError) -> list[_Key]:
    """What an error asks for, a column last: that a file has one is seldom not known to bushfit."""
    found = [(kind or option.replace("-", "_"), role) for kind, role, option in _NAMED.findall(error.hint or "")]
    known = [(name, role) for name, role in found if role or name in STATED or name in _WORDS]
    return sorted(known, key=lambda key: key[0] == "column")


def _is_about(error: BushfitError, key: _Key, answer: Any) -> bool:
    """Whether an error tells of an answer."""
    place, quoted = option_of(key[0]) in (error.place or ""), f'"{answer}"' in error.problem
    return place or quoted or (error.found or "").strip('"') == str(answer)
