"""Result of a fit: a model, the uncertainty of its values, and its agreement with the tests."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from bushfit.caveat import Caveat, join_names
from bushfit.effects import BASE
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.effects.unnamed import SmoothCorrection
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction, Place, Specimen, get_place
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.reading.measurement import Source, Stepped
from bushfit.reading.preload import Preload
from bushfit.units import display_unit, format_aligned, number
from bushfit.validation import Flag, Number, WholeNumber

#: Picture as a data URI, the only form of a logo that a page shows.
_PICTURE = re.compile(r"data:image/(png|svg\+xml);base64,[A-Za-z0-9+/]+=*")
#: Largest ratio of half width to value in an exponential: exp(300) exceeds the bounds of all parameters and is finite.
_LARGEST_EXPONENT = 300.0

#: Bound of a parameter: its smallest or its largest value.
End = Literal["min", "max"]


@dataclass(frozen=True)
class Quality:
    """Agreement of a model with the data that it was fitted to.

    Args:
        nrmse: root mean square of model minus measurement: of complex stiffness relative to |K|, of a loop's force
            relative to half its range.
        reduced_chi_square: sum of squared residuals in units of noise per degree of freedom; 1 if only noise remains.
        points: number of residuals.
        noise: relative standard deviation of the noise of one point, root mean square over all points.
        loop_gain_error: relative standard deviation of the force gain of a loop, by the accuracy class of the rig; None
            without loops, or if an older file does not state it.
    """

    nrmse: Number
    reduced_chi_square: Number
    points: WholeNumber
    noise: Number
    loop_gain_error: Number | None = None


@dataclass(frozen=True)
class PreloadRange:
    """Preloads of the fitted tests of one direction or specimen.

    Args:
        place: name of the direction or specimen.
        unit: SI unit of the preloads, of a displacement (such as m) or of a force (such as N).
        low: smallest preload, in `unit`.
        high: largest preload, in `unit`.
        count: number of distinct preloads.
    """

    place: str
    unit: str
    low: Number
    high: Number
    count: WholeNumber

    def text(self, place: Place) -> str:
        """Smallest and largest preload for users, such as "0 to 1.5 mm", in the direction or specimen `place`."""
        (low, unit), (high, _) = (Preload(end, self.unit).in_display_unit(place) for end in (self.low, self.high))
        return f"{number(low, 4)} to {number(high, 4)} {unit}"


@dataclass(frozen=True)
class Range:
    """Ranges of the operating conditions of the fitted tests.

    Args:
        frequency: lowest and highest frequency [Hz].
        strain: smallest and largest equivalent strain amplitude [1].
        directions: names of the directions and specimens; empty if an older file does not state them.
        temperature: lowest and highest temperature [K]; None if no test states one.
        preloads: preloads of each direction or specimen that was tested at two or more.
    """

    frequency: tuple[float, float]
    strain: tuple[float, float]
    directions: tuple[str, ...] = ()
    temperature: tuple[float, float] | None = None
    preloads: tuple[PreloadRange, ...] = ()


@dataclass(frozen=True)
class Misfit:
    """Misfit between a model and one test, or one run of a sweep (its points at one amplitude or frequency).

    Args:
        test: name of the test.
        place: name of the direction or specimen.
        fitted: True if the model was fitted to this test.
        held: quantity that is constant in the run, "amplitude" or "frequency"; None for the whole test.
        value: constant value of this quantity; None for the whole test.
        unit: SI unit of the value: "m", "rad" or "1" for an amplitude, "Hz" for a frequency.
        points: number of points with weight: operating points of a sweep, rows of a loop.
        nrmse: root mean square difference of the complex stiffness relative to |K|, or of a loop's force relative to
            half its range.
        reduced_chi_square: mean square residual in units of noise.
        gain: mean relative difference of |K|, measured minus model: positive if the test is stiffer than the model.
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
class ExpectedError:
    """Expected error of a model for one direction or specimen: 95 % of the measured points have a smaller error.

    Args:
        place: name of the direction or specimen.
        stiffness: absolute value of the relative error of |K|.
        loss_factor: absolute value of the error of the loss factor, not relative.
        points: number of compared operating points; a loop is one point.
        held_out: True if each point was predicted by a fit without its run, False if by the fit to all points.
    """

    place: str
    stiffness: Number
    loss_factor: Number
    points: WholeNumber
    held_out: Flag


@dataclass(frozen=True)
class Outlier:
    """Measured point that deviates from the model by more than noise explains, unlike its neighbours.

    Args:
        test: name of the test.
        file: data file as named in the campaign; None if the test has no file.
        row: row of the data, from 1, without header, comments and blank lines.
        column: "displacement", "force" or "stiffness".
        distance: deviation in units of noise.
    """

    test: str
    file: str | None
    row: WholeNumber
    column: str
    distance: Number


@dataclass(frozen=True)
class PriorUse:
    """Influence of the prior of a parameter on its estimate.

    Args:
        source: prior as the campaign states it, such as "0.24 +- 0.03".
        mean, deviation: mean and standard deviation of the prior [SI].
        share: share of the information on the parameter that comes from the prior, 0 to 1.
        distance: difference of the tests from the prior, in standard deviations.
    """

    source: str
    mean: Number
    deviation: Number
    share: Number
    distance: Number


@dataclass(frozen=True)
class Alternative:
    """Alternative model that the tests do not rule out.

    Args:
        model: the alternative model with its fitted values.
        probability: probability of this model by the diagnosis.
        covariance: covariance of the parameters in the fit of this model.
    """

    model: Model
    probability: float
    covariance: Covariance = field(default_factory=Covariance)


@dataclass(frozen=True)
class TestTable:
    """Description of one test of a campaign: ranges, levels, file and conditions.

    Args:
        test: name of the test.
        kind: "loop" or "sweep".
        place: name of the direction or specimen.
        frequency_Hz: lowest and highest frequency [Hz].
        amplitude: smallest and largest zero-to-peak amplitude, in `unit`.
        unit: SI unit of the amplitude; "1" for a strain.
        rows: number of rows of a loop, or of operating points of a sweep.
        repeats: number of measurements of each operating point.
        frequencies_Hz, amplitudes: levels of a sweep in ascending order [Hz; `unit`]; empty for loops and older files.
        stepped: quantity that a sweep steps through, "frequency" or "amplitude"; null for a loop.
        file: data file; null if the test has no file.
        sha256: SHA-256 checksum of the data file.
        conditions: conditions that the campaign states, such as temperature, preload or date.
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
    conditions: Mapping[str, str | WholeNumber | Number] = field(default_factory=dict)


@dataclass(frozen=True)
class CampaignTable:
    """Campaign (set of tests) that a model was fitted to.

    Args:
        name: name of the campaign.
        file: name of the campaign file.
        sha256: SHA-256 checksum of the campaign file.
        command: command line that reproduces the numbers, for the folder of the campaign file.
        tests: all tests of the campaign.
        report: entries of the report's head: customer, part_number, drawing, compound, laboratory and date, if known.
        logo: logo for the report's head, as a data URI of a PNG or SVG; null without a logo.
    """

    name: str
    file: str
    sha256: str
    command: str
    tests: tuple[TestTable, ...] = ()
    report: Mapping[str, str] = field(default_factory=dict)
    logo: Annotated[str, Field(max_length=100_000)] | None = None

    def __post_init__(self) -> None:
        """Raise a ValueError for a logo that is not a PNG or SVG as a data URI."""
        if self.logo is not None and not _PICTURE.fullmatch(self.logo):
            expected = "data:image/png;base64, or data:image/svg+xml;base64, and the picture"
            raise ValueError(ModelError("this is not a picture", place="logo", found=self.logo, expected=expected))


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Fitted model, or a model given by hand, with its uncertainty, quality and origin; content of a model file.

    Args:
        model: the model with its parameter values.
        fitted: names of the fitted parameters.
        covariance: covariance of the fitted parameters, and of fixed parameters whose error is known.
        quality: agreement with the fitted tests; None if the model was not fitted.
        measured: ranges of the fitted tests; None if the model was not fitted.
        warnings: warnings on the use of the numbers.
        inputs: data files of the tests.
        outliers: measured points far outside their noise.
        profile: 95 % intervals by profile likelihood, if requested, by parameter [SI]; None for an open end.
        at_bound: parameters whose fitted value is at a bound, and which bound.
        specimens: specimens of the compound other than the bushing.
        tests: misfit of each test and run.
        usable: expected error for each direction or specimen.
        unresolved: effects of the model that these tests cannot distinguish from an effect of the rig.
        model_error: error of the model that the fit assumed in addition to noise, relative to the stiffness, or the
            smooth correction of the bushing that the compound was transferred from; None if there is neither.
        alternatives: other models that the tests do not rule out.
        campaign: description of the campaign; None for a model without a campaign.
        ties: expressions of the parameters whose values follow from others, by name.
        priors: use of the prior of each parameter that has one, by name.
    """

    model: Model
    fitted: tuple[str, ...] = ()
    covariance: Covariance = field(default_factory=Covariance)
    quality: Quality | None = None
    measured: Range | None = None
    warnings: tuple[Caveat, ...] = ()
    inputs: tuple[Source, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    profile: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    at_bound: Mapping[str, End] = field(default_factory=dict)
    specimens: tuple[Specimen, ...] = ()
    tests: tuple[Misfit, ...] = ()
    usable: tuple[ExpectedError, ...] = ()
    unresolved: tuple[str, ...] = ()
    model_error: SmoothCorrection | None = None
    alternatives: tuple[Alternative, ...] = ()
    campaign: CampaignTable | None = None
    ties: Mapping[str, str] = field(default_factory=dict)
    priors: Mapping[str, PriorUse] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Text with one line per parameter (value and standard error), and the quality of the fit."""
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
        """Name of the bushing, or of several bushings, or else of the first specimen."""
        if self.model.bushing or not self.specimens:
            return self.model.name
        return " and ".join(bushing.name for bushing in self.bushings) or self.specimens[0].name

    @property
    def files(self) -> dict[str, str]:
        """SHA-256 of each test file, by its path; a file with several tests is listed once."""
        return {str(source.file): source.sha256 for source in self.inputs}

    @property
    def bushings(self) -> list[Bushing]:
        """Bushings of the compound, if several were tested."""
        return [*dict.fromkeys(specimen.bushing for specimen in self.specimens if specimen.bushing)]

    @property
    def rival_warnings(self) -> list[Caveat]:
        """Warning that the tests do not rule out other models, in a list; empty if they do."""
        if not self.alternatives:
            return []
        used = "a smooth correction" if self.model.unnamed else "the most probable model"
        sentence = "the tests permit other values of the parameters"
        if self.possible_causes:
            sentence = f"the prediction uses {used}, but the tests permit {join_names(self.possible_causes, 'or')}"
        return [Caveat("undecided", f"{sentence}: the bands, low to high, include each alternative")]

    @property
    def possible_causes(self) -> list[str]:
        """Effects that the model lacks and the tests do not rule out, such as "delay + inertia"."""
        rivals = (one.model.effects for one in self.alternatives if not {*one.model.effects} <= {*self.model.effects})
        return [" + ".join(name for name in effects if name not in (*BASE, UNNAMED)) for effects in rivals]

    @property
    def fitted_places(self) -> list[Place]:
        """Directions and specimens that were fitted, except those of another bushing of the compound."""
        names = self.measured.directions if self.measured else ()
        places: dict[str, Place] = {str(place): place for place in (*Direction, *self.specimens)}
        return [places[name] for name in names if name in places]

    def place(self, name: str) -> Place:
        """Return the direction or specimen with the given name; raise a ModelError for other names."""
        return get_place(name, self.specimens)

    def interval(self, name: str) -> tuple[float, float] | None:
        """95 % interval of a parameter, cut at its bounds.

        Returns:
            Lower and upper end [SI unit of the parameter]; None if the parameter was fixed at an exact value.

        Notes: symmetric in the logarithm for strictly positive parameters, and in the value for others.

        >>> fitted = Result(paper, ("mu",), Covariance(("mu",), np.array([[1e8]])))
        >>> [round(end) for end in fitted.interval("mu")]
        [1070575, 1109777]
        """
        stderr, value = self.covariance.stderr(name), self.model.values[name]
        if stderr is None:
            return None
        parameter = self.model.parameters[name]
        half = self.covariance.half_widths[name]
        low, high = value - half, value + half
        if parameter.log and value > 0.0:
            factor = float(np.exp(min(half / value, _LARGEST_EXPONENT)))
            low, high = value / factor, value * factor
        minimum, maximum = parameter.bounds
        return max(low, min(minimum, value)), min(high, max(maximum, value))
