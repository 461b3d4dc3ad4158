"""Result of a fit: a model, the uncertainty of its values, and its agreement with the tests."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from bushfit.effects import Level
from bushfit.effects.unnamed import Unnamed
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Place, Specimen, get_place
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.reading.measurement import Source, Stepped
from bushfit.units import display_unit, format_aligned, number
from bushfit.validation import Flag, Number, WholeNumber

#: A picture as a data URI: what a page may show of a file that somebody else wrote, and nothing else.
_PICTURE = re.compile(r"data:image/(png|svg\+xml);base64,[A-Za-z0-9+/]+=*")
#: Largest half width, in units of the value, of which the exponential is taken: exp(300) is far beyond every bound of
#: a parameter, and still a finite number.
_LARGEST_EXPONENT = 300.0

#: The least or the largest value that a parameter may have.
End = Literal["min", "max"]


@dataclass(frozen=True)
class Quality:
    """How well a model meets the data it was fitted to.

    Args:
        nrmse: root mean square difference, relative to half a loop's force range and to |K|.
        reduced_chi_square: mean square residual in units of noise; 1 where noise is all that is left.
        points: number of residuals.
        noise: standard deviation of one point, relative, root mean square over all.
        loop_gain_error: standard deviation of a loop's gain, relative, by the class of the rig; None without loops, and
            where an older file does not say it.
    """

    nrmse: Number
    reduced_chi_square: Number
    points: WholeNumber
    noise: Number
    loop_gain_error: Number | None = None


@dataclass(frozen=True)
class Range:
    """The operating conditions of the tests that were fitted.

    Args:
        frequency: least and largest [Hz].
        strain: least and largest equivalent strain amplitude.
        directions: of the tests, and specimens, by name; none where an older file does not say which.
        temperature: lowest and highest [K]; None where no test states one.
    """

    frequency: tuple[float, float]
    strain: tuple[float, float]
    directions: tuple[str, ...] = ()
    temperature: tuple[float, float] | None = None


@dataclass(frozen=True)
class Misfit:
    """How well a model meets one test, or one run of it.

    Args:
        test: by its name.
        place: direction, or specimen by its name.
        fitted: whether the model was fitted to it.
        held: what the run holds; None of the whole test.
        value: at which it is held.
        unit: of the value, SI: "m", "rad" or "1" of an amplitude, "Hz".
        points: that carry weight: operating points of a sweep, rows of a loop.
        nrmse: root mean square difference, relative to |K| or to half the loop's force range.
        reduced_chi_square: mean square residual in units of noise.
        gain: |K| of the model over the measured one, less 1, mean of the points.
    """

    test: str
    place: str
    fitted: Flag
    held: Literal["amplitude", "frequency"] | None
    value: Number | None
    unit: str | None
    points: WholeNumber
    nrmse: Number
    reduced_chi_square: Number
    gain: Number


@dataclass(frozen=True)
class Usable:
    """Within what a model meets the measurement at a place: 95 % of the points lie nearer.

    Args:
        place: direction, or specimen by its name.
        stiffness: relative difference of |K|.
        loss_factor: difference of the loss factor.
        points: operating points that were compared; a loop is one.
        held_out: whether each was predicted from the fit without its run; else from the fit to all.
    """

    place: str
    stiffness: Number
    loss_factor: Number
    points: WholeNumber
    held_out: Flag


@dataclass(frozen=True)
class Outlier:
    """A point that lies farther from the model than noise explains, beside neighbours that do not.

    Args:
        test: by its name.
        file: it came from, as the campaign names it; None for a test that came from no file.
        row: of its data, from 1; header, comments and blank lines do not count.
        column: displacement, force or stiffness.
        distance: from where it should be, in units of noise.
    """

    test: str
    file: str | None
    row: WholeNumber
    column: str
    distance: Number

    @property
    def place(self) -> str:
        """File, or test, and column, for messages that list the rows."""
        return f"{self.file or self.test}, {self.column}"


@dataclass(frozen=True)
class Alternative:
    """Another model that may be the right one, as the tests cannot tell.

    Args:
        probability: of it, by the diagnosis that found it.
    """

    model: Model
    probability: float


@dataclass(frozen=True)
class TestTable:
    """A test of the campaign, its range, and what the campaign says of it.

    Args:
        test: its name.
        kind: "loop" or "sweep".
        place: direction, or specimen by its name.
        frequency_Hz: least and largest [Hz].
        amplitude: least and largest, zero-to-peak, in the unit.
        unit: of the amplitude, SI; "1" of a strain.
        rows: of a loop, or operating points.
        repeats: of each operating point.
        frequencies_Hz, amplitudes: levels of a sweep, rising [Hz; the unit]; none of a loop, or of an older file.
        stepped: what a sweep steps through, "frequency" or "amplitude"; null of a loop.
        file: that it was read from; null where it came from none.
        sha256: of the file.
        conditions: that the campaign states, such as its temperature, preload or date.
    """

    __test__ = False  # no test of pytest's

    test: str
    kind: str
    place: str
    frequency_Hz: tuple[Number, Number]  # noqa: N815
    amplitude: tuple[Number, Number]
    unit: Literal["m", "rad", "1"]
    rows: WholeNumber
    frequencies_Hz: tuple[Number, ...] = ()  # noqa: N815
    amplitudes: tuple[Number, ...] = ()
    repeats: WholeNumber = 1
    stepped: Stepped | None = None
    file: str | None = None
    sha256: str | None = None
    conditions: Mapping[str, str | Number] = field(default_factory=dict)


@dataclass(frozen=True)
class CampaignTable:
    """The campaign that a model comes from.

    Args:
        name: of the campaign.
        file: its name.
        sha256: of the file.
        command: with all that settles the numbers, as it would be typed beside the file.
        tests: all that the campaign has.
        report: head of the report: customer, part_number, drawing, compound, laboratory and date, if
            they are known.
        logo: beside it, as a data URI of a PNG or SVG; null without a logo.
    """

    name: str
    file: str
    sha256: str
    command: str
    tests: tuple[TestTable, ...] = ()
    report: Mapping[str, str] = field(default_factory=dict)
    logo: Annotated[str, Field(max_length=100_000)] | None = None

    def __post_init__(self) -> None:
        if self.logo is not None and not _PICTURE.fullmatch(self.logo):
            expected = "data:image/png;base64, or data:image/svg+xml;base64, and the picture"
            raise ValueError(ModelError("this is no picture", place="logo", found=self.logo, expected=expected))


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A fitted model, or one given by hand, as the JSON files hold it.

    Args:
        covariance: of the fitted parameters, and of held ones whose error is known.
        quality: None where the model was not fitted.
        measured: operating conditions of the tests that were fitted; None where the model was not fitted.
        warnings: warnings on the use of the numbers.
        profile: 95 % intervals by profile likelihood, where they were asked for; None is an open end.
        at_bound: parameters that came to rest on the least or largest value they may have, and on which.
        unresolved: effects of the model with a twin of the rig, which these tests cannot tell from it.
        model_error: what the fit counted beside noise, as a share of the stiffness, or what corrected the bushing that
            a compound was carried from; None where noise was all.
        alternatives: models that explain the tests, where these cannot tell which does.
        campaign: as the model file has it; None of a model that comes from none, or that no file was read for.
    """

    model: Model
    fitted: tuple[str, ...] = ()
    covariance: Covariance = field(default_factory=Covariance)
    quality: Quality | None = None
    measured: Range | None = None
    warnings: tuple[str, ...] = ()
    inputs: tuple[Source, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    profile: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    at_bound: Mapping[str, End] = field(default_factory=dict)
    specimens: tuple[Specimen, ...] = ()
    tests: tuple[Misfit, ...] = ()
    usable: tuple[Usable, ...] = ()
    unresolved: tuple[str, ...] = ()
    model_error: Unnamed | None = None
    alternatives: tuple[Alternative, ...] = ()
    campaign: CampaignTable | None = None

    def __repr__(self) -> str:
        """The parameters with their standard errors, a line each, and how well the model meets its tests."""
        lines = [f"Result of {self.name}"]
        for name, parameter in self.model.parameters.items():
            value, stderr = self.model.values[name], self.covariance.stderr(name)
            unit, factor = display_unit(parameter.unit, 1.0, value)
            error, size = (
                format_aligned([stderr * factor, value * factor], 2) if stderr else ("", number(value * factor, 4))
            )
            lines.append(f"  {name} = {' +- '.join(filter(None, (size, error)))} {unit}".removesuffix(" -"))
        if self.quality:
            misfit, chi_square = number(100 * self.quality.nrmse, 2), number(self.quality.reduced_chi_square, 3)
            lines.append(f"  NRMSE {misfit} %, reduced chi-square {chi_square}")
        return "\n".join(lines)

    @property
    def name(self) -> str:
        """Name of the bushing, or of the first specimen if the result has no bushing."""
        return self.specimens[0].name if self.specimens and not self.model.bushing else self.model.name

    @property
    def left_open(self) -> str:
        """Sentence on the parameters that are unknown by 100 % or more; "" if every parameter is known."""
        return self.covariance.left_open(self.model.values)

    @property
    def undecided(self) -> list[str]:
        """A warning where the tests leave several models possible; none where they do not."""
        if not self.alternatives:
            return []
        added = (sorted(set(alternative.model.effects) - {*self.model.effects}) for alternative in self.alternatives)
        names = list(dict.fromkeys(" + ".join(alternative) for alternative in added if alternative))
        choice = "cannot distinguish between" if len(names) > 1 else "do not show whether the model lacks"
        lacking = f"the tests {choice} {' and '.join(names)}: the prediction uses the plain model, and"
        open_values = "the tests permit other values of the parameters:"
        return [f"{lacking if names else open_values} the bands, low to high, include each alternative"]

    def place(self, name: str) -> Place:
        """The specimen of this name, or else the direction; a ModelError where it is neither."""
        return get_place(name, self.specimens)

    def interval(self, name: str) -> tuple[float, float] | None:
        """95 % interval of a parameter [its SI unit], cut at its bounds; None where it was held at an exact value.

        Returns:
            Lower and upper end [SI], or None.

        Notes: symmetric in the logarithm for strictly positive parameters, and in the value for others.

        >>> fitted = Result(paper, ("mu",), Covariance(("mu",), np.array([[1e8]])))
        >>> [round(end) for end in fitted.interval("mu")]
        [1070575, 1109777]
        """
        stderr, value = self.covariance.stderr(name), self.model.values[name]
        if stderr is None:
            return None
        parameter = self.model.parameters[name]
        half = self.covariance.half(name)
        low, high = value - half, value + half
        if parameter.log and value > 0.0:
            factor = float(np.exp(min(half / value, _LARGEST_EXPONENT)))
            low, high = value / factor, value * factor
        minimum, maximum = parameter.bounds
        return max(low, min(minimum, value)), min(high, max(maximum, value))


def carried(result: Result, bushing: Bushing) -> tuple[Result, str]:
    """The compound of a fitted model in another bushing, and a sentence on what stayed behind.

    What belongs to the material is kept, and the factors of specimens of it.

    Returns:
        Result for the other bushing, and the sentence.
    """
    names = [specimen.name for specimen in result.specimens]

    def transfer(model: Model) -> Model:
        effects = [
            record.name for record in model.records if record.level is Level.MATERIAL or record.corrects in names
        ]
        return Model.with_defaults(bushing, effects, model.values)

    model = transfer(result.model)
    measured = result.measured
    if measured:
        of_specimens = tuple(name for name in measured.directions if name in names)
        measured = replace(measured, directions=of_specimens or (result.name,))
    elsewhere = Result(
        model,
        fitted=tuple(name for name in result.fitted if name in model.values),
        covariance=result.covariance.restricted([*model.values]),
        measured=measured,
        warnings=tuple(f"{result.name}: {line}" for line in result.warnings if line not in result.undecided),
        inputs=result.inputs,
        specimens=result.specimens,
        unresolved=tuple(name for name in result.unresolved if name in model.effects),
        model_error=result.model_error or result.model.unnamed,
        alternatives=tuple(replace(record, model=transfer(record.model)) for record in result.alternatives),
    )
    sentence = f"{bushing.name}: the compound of {result.name}, of which no bushing of this shape was tested"
    if omitted := ", ".join(record.name for record in result.model.records if record.name not in model.effects):
        sentence += f"; left out, because they belong to {result.name} or its rig: {omitted}"
    return elsewhere, sentence
