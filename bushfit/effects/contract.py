"""Records that describe an effect, of one of three kinds: branch, modifier or layer.

The measured response is built from the rubber outward. Inside are *branches* in parallel, each adding a stress.
Around them lie *layers*: each takes the response below it and returns the response above it. A *modifier* changes
values that the branches use, by operating condition, and is evaluated before them. Layers are ordered by level
(material, component, instrument), never by the order in which they were added.

Each effect has a complex stiffness over frequency and amplitude, and a force over time.

Notes:
    Both broadcast. The last axis holds operating points or samples. Parameter values are numbers, or arrays whose last
    axis has length 1: a Jacobian by differences or a bootstrap is one call with the values along a leading axis.

    In the examples of the laws `paper` is the model of the paper's bushing, `spring` the response below a layer, of 500
    N/mm, and `sweep` and `loop` are axial tests of that bushing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.history import Array as Array
from bushfit.effects.history import History as History
from bushfit.geometry import STRAINING, Bushing, Direction, Place
from bushfit.reading.preload import Preload

if TYPE_CHECKING:
    from bushfit.effects.unnamed import SmoothCorrection

#: Frequency [Hz] and strain amplitude [1] at which the effect laws have their reference value; most tests include it.
REFERENCE_FREQUENCY = 25.0
REFERENCE_STRAIN = 0.01

#: Distance from a bound, in fitted coordinates, up to which a parameter is at the bound.
AT_BOUND = 1e-3

#: A number, or an array that broadcasts against operating points or samples.
Value = Any
#: Parameter values by name.
Values = Mapping[str, Value]
#: Function from a displacement history to the force [N or N m] of the bushing and the inner layers.
ForceBelow = Callable[[History], Array]


class StiffnessBelow(Protocol):
    """Steady response inside a layer, without this layer and those around it; argument of `Layer.stiffness`."""

    def __call__(self, omega: Array, amplitude: Array, /) -> Array:
        """Complex dynamic stiffness [N/m or N m/rad] at omega [rad/s] and amplitude [m or rad]."""

    def cycle(self, omega: Array, motion: Array, points: Any) -> Array:
        """Force over one steady cycle of any waveform, for layers that distort the waveform.

        Args:
            omega: angular frequencies [rad/s], (..., k).
            motion: displacement over the cycle [m or rad], (..., k, samples).
            points: numpy index of these k operating points in the test.
        """


class Level(IntEnum):
    """Level at which an effect acts, from the rubber outward; predictions leave out instrument and record effects."""

    MATERIAL = 1
    COMPONENT = 2
    INSTRUMENT = 3
    RECORD = 4

    def __str__(self) -> str:
        return self.name.lower()


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Args:
        name: ASCII name; files and reports use `<effect>.<name>`, except for elastic, springpot and friction.
        unit: SI unit; "1" for a ratio.
        bounds: smallest and largest plausible value.
        neutral: value at which the effect vanishes; None for a parameter that cannot make the effect vanish.
        typical: usual distance from the neutral value (from 0 if None), by which a fit scales the parameter.
        meaning: description for users.
        log: True if a fit varies the logarithm of the (positive) parameter.
        opposite: description of minus the value, if users understand it better where the value is negative.
        scale: quantity of the tests that determines the start value in a search: "period", "frequency", "displacement",
            "strain" or "force"; "session" for a share of the session's duration; "order" for the order of a
            derivative; None if `typical` suits all tests.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    neutral: float | None
    typical: float
    meaning: str
    log: bool = False
    opposite: str = ""
    scale: Literal["period", "frequency", "displacement", "strain", "force", "order", "session"] | None = None

    def value_at_share(self, share: float) -> float:
        """Neutral value (0 if None) plus a share of the typical distance from it, in the parameter's SI unit."""
        return (self.neutral or 0.0) + share * self.typical

    def reached_bound(self, value: float) -> Literal["min", "max"] | None:
        """Bound that a value is at, within `AT_BOUND` of the fitted coordinate; None between the bounds."""
        low, high = self.bounds
        low, point, high = (math.log(x) if self.log else x / self.typical for x in (low, value, high))
        near = AT_BOUND * min(high - low, 1.0)
        return "min" if point - low < near else "max" if high - point < near else None


@dataclass(frozen=True, eq=False)
class RubberConditions:
    """Temperature, strain history and preload in a test; effects that depend on an unknown (None) do nothing.

    Args:
        temperature: temperature of the rubber [K], a number or one per operating point, (n,).
        session_time: time of the measurement, from 0 at the first to 1 at the last point of the session, (n,).
        largest_strain: largest strain amplitude that the rubber had undergone before the measurement [1], (n,).
        previous_strain: last earlier strain amplitude larger than that of the point [1], (n,); 0 without any.
        rest_time: time since that larger amplitude, as a share of the session, (n,).
        preload: static displacement or force of the test.
    """

    temperature: Array | float | None = None
    session_time: Array | float | None = None
    largest_strain: Array | float | None = None
    previous_strain: Array | float | None = None
    rest_time: Array | float | None = None
    preload: Preload | None = None

    def select(self, points: Any) -> RubberConditions:
        """Return the conditions of some operating points, by their numpy index; single numbers apply to all points."""
        quantities = vars(self).values()
        return RubberConditions(*(value[points] if isinstance(value, np.ndarray) else value for value in quantities))


#: Unknown conditions, as in a prediction.
UNKNOWN = RubberConditions()


@dataclass(frozen=True)
class Setting:
    """Test for which a response is computed.

    Args:
        bushing: geometry of the bushing; None if only specimens are tested.
        direction: direction of the motion, or the specimen under test.
        kind: "sweep" or "loop"; some effects belong to the rig of one kind only.
        conditions: temperature and history of the rubber during the test.
        unnamed: data of the smooth correction `unnamed`; None if the model does not include this effect.
    """

    bushing: Bushing | None
    direction: Place
    kind: Literal["sweep", "loop"]
    conditions: RubberConditions = UNKNOWN
    unnamed: SmoothCorrection | None = None


@dataclass(frozen=True)
class Condition:
    """Operating points and test for which a modifier changes parameter values: an argument of `Modifier.adjust`.

    Args:
        setting: the test.
        omega: angular frequency [rad/s], (..., n).
        amplitude, strain: displacement amplitude [m or rad] and equivalent strain amplitude [1], (..., n).
        stiffness: function from parameter values to the complex stiffness of the rubber [N/m or N m/rad], (..., n).
        moduli: names of all moduli and stresses of the model; the stiffness is proportional to them.
    """

    setting: Setting
    omega: Array
    amplitude: Array
    strain: Array
    stiffness: Callable[[Values], Array]
    moduli: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Properties that all effects have.

    Args:
        name: name in files, reports and options, and name of the Python file with the equations.
        sentence: description for an engineer.
        equation: equation of the first harmonic, ASCII.
        level: level at which it acts.
        parameters: parameters of the effect.
        source: literature reference.
        confirmed_by: simplest test that would confirm the effect.
        harmonic_error: relative error of the first-harmonic equation compared with the equation in time; 0 if exact.
        is_transient: True if the response changes from cycle to cycle, so that all cycles of a loop are computed.
        corrects: direction or specimen whose stiffness formula the effect scales by a fitted factor, so that the error
            of the formula needs no warning; None for other effects.
        twins: effects with the same equation in all tests, mostly of the rig. The effect of the bushing, which lists
            the twins, is proposed; the tests determine its size but cannot distinguish it from its twins.
        replaces: name of the branch (elastic, springpot or friction) that the effect replaces; None if it is added.
        depends_on: names of the `RubberConditions` on which the effect depends.
        assumption: warning on the value of these quantities in a prediction; None for effects of the rig.
        in_place_of: function that converts the values of the replaced branch to start values for a fit, the most
            probable first; None if the effect replaces no branch.
        harmonic_only: True if the effect has no equation in time: in loops it contributes to the first harmonic alone
            (see `harmonic_stress`), and the virtual rig refuses it.
        after: effect that must be in the model before this effect is searched.
        never_with: effects with which this effect is not combined in a search, because together they fit any data.
        limit: simpler effect that this effect becomes at a bound of its parameters; None without such a limit.
    """

    name: str
    sentence: str
    equation: str
    level: Level
    parameters: tuple[Parameter, ...]
    source: str
    confirmed_by: str = ""
    harmonic_error: float = 0.0
    is_transient: bool = False
    corrects: str | None = None
    twins: tuple[str, ...] = ()
    replaces: str | None = None
    depends_on: tuple[
        Literal["temperature", "session_time", "largest_strain", "previous_strain", "rest_time", "preload"], ...
    ] = ()
    assumption: Caveat | None = None
    harmonic_only: bool = False
    in_place_of: Callable[[Values], list[dict[str, float]]] | None = None
    after: str | None = None
    never_with: tuple[str, ...] = ()
    limit: str | None = None

    @property
    def phrase(self) -> str:
        """Description of the effect up to the first colon or semicolon, for use within another sentence."""
        short = re.split("[:;]", self.sentence.rstrip("."))[0]
        return short[0].lower() + short[1:]

    def acts_at(self, place: Place) -> bool:
        """Return True if the effect acts in this direction or specimen; a name such as `inertia` has no restriction.

        Of several bushings, `stiffness_factor.long` acts on all tests of the bushing "long", `stiffness_factor.radial`
        on the radial tests of all bushings, and `stiffness_factor.long radial` on the radial tests of one.
        """
        return self.name.partition(".")[2] in ("", *place.labels)

    @property
    def is_friction(self) -> bool:
        """True if the effect is a law of the filler's friction, beside that of the model or in place of it."""
        return self.replaces == "friction" or any(parameter.scale == "strain" for parameter in self.parameters)

    @property
    def amount(self) -> Parameter:
        """First parameter with a neutral value; a search for the effect varies this parameter."""
        return next(parameter for parameter in self.parameters if parameter.neutral is not None)


@dataclass(frozen=True, kw_only=True)
class Branch(Effect):
    """Effect that adds a stress of the rubber, in parallel with the other branches.

    Args:
        modulus: (values, omega [rad/s], strain amplitude) -> complex modulus s~ / (2 e~) of the first harmonic [Pa].
        stress: (values, strain history) -> stress [Pa].
        uses: names of parameters of other branches, such as mu, that the branch reads.
        size: name of the parameter that the modulus of a linear viscoelastic branch is proportional to, so that Maxwell
            arms can replace the branch; None for other branches. Over a steady cycle, the modulus of a linear branch
            gives every harmonic of the stress, mean included, and `stress` is not used.
    """

    level: Level = Level.MATERIAL
    modulus: Callable[[Values, Array, Array], Array]
    stress: Callable[[Values, History], Array]
    uses: tuple[str, ...] = ()
    size: str | None = None


@dataclass(frozen=True, kw_only=True)
class Modifier(Effect):
    """Effect that changes the parameter values of other effects, depending on the operating condition.

    Args:
        adjust: (values, condition) -> the changed values only, by parameter name.
        shift_factor: (values, test conditions) -> time-temperature shift factor a_T; None without a shift.
        stress: (values, strain history, setting) -> stress [Pa] to add in the time domain; None without one. Its first
            harmonic is zero, since `adjust` gives the stiffness.
    """

    level: Level = Level.MATERIAL
    adjust: Callable[[Values, Condition], dict[str, Value]]
    shift_factor: Callable[[Values, RubberConditions], Value] | None = None
    stress: Callable[[Values, History, Setting], Array] | None = None


@dataclass(frozen=True, kw_only=True)
class Layer(Effect):
    """Effect that converts the response of the rubber and the inner layers into the response outside the layer.

    Args:
        turns: True if the layer also acts in torsion.
        adds: name of the parameter to sum over adjacent layers with the same equation, such as compliances in series.
        response_factor: (values, setting) -> number or array by which the layer multiplies both stiffness and force;
            None for other layers, which have the next two functions.
        stiffness: (values, response below, omega [rad/s], amplitude [m or rad], setting) -> complex stiffness outside.
        force: (values, force below, displacement history, setting) -> force outside the layer [N or N m].
    """

    turns: bool = True
    adds: str | None = None
    response_factor: Callable[[Values, Setting], Value] | None = None
    stiffness: Callable[[Values, StiffnessBelow, Array, Array, Setting], Array] | None = None
    force: Callable[[Values, ForceBelow, History, Setting], Array] | None = None

    def __post_init__(self) -> None:
        """Raise a TypeError for a layer without functions of the stiffness and the force."""
        if not (self.response_factor or (self.stiffness and self.force)):
            raise TypeError("a layer needs the functions stiffness and force, or response_factor")

    def acts_at(self, place: Place) -> bool:
        """Return True if the layer acts in tests of this direction or specimen.

        Tests of a modulus have neither rig nor sleeve: only a layer with `corrects`, a corrected formula, acts there.
        """
        acts = self.corrects is not None if place.motion is STRAINING else self.turns or not place.is_rotation
        return acts and super().acts_at(place)


@dataclass(frozen=True, eq=False)
class Family:
    """Effects with the same equation, one for each direction or specimen.

    Args:
        record: effect with the placeholder {place} in its texts. The effect acts only in tests of one direction or
            specimen; the effect and its one parameter are named `<name>.<place>`.
        places: function that selects, from the names of the tested directions and specimens (axial first), those for
            which a search considers the effect.
        radial: texts for the radial direction that differ from those of the record.
    """

    record: Effect
    places: Callable[[Sequence[str]], Sequence[str]]
    radial: Mapping[str, Any]

    @cache  # noqa: B019  # the families live as long as the program
    def of_place(self, place: str) -> Effect:
        """Return the family's effect for one direction or specimen; cached."""
        record = replace(self.record, **(self.radial if place == Direction.RADIAL else {}))
        values = {member.name: getattr(record, member.name) for member in fields(record)}
        texts: dict[str, Any] = {key: text.format(place=place) for key, text in values.items() if isinstance(text, str)}
        parameters = tuple(replace(one, meaning=one.meaning.format(place=place)) for one in record.parameters)
        twins = tuple(twin.format(place=place) for twin in record.twins)
        return replace(record, **texts, parameters=parameters, twins=twins)


def scaled_values(p: Values, names: tuple[str, ...], factor: Value) -> dict[str, Value]:
    """Multiply some parameter values by a factor, as most modifiers do.

    Args:
        p: parameter values by name.
        names: names of the values to multiply; names without a value are ignored.
        factor: number, or array that broadcasts against operating points.

    Returns:
        The changed values by name.

    >>> scaled_values({"mu": 1e6}, ("mu", "m"), 0.5)
    {'mu': 500000.0}
    """
    return {name: p[name] * factor for name in names if name in p}


def harmonic_stress(modulus: Callable[[Values, Array, Array], Array], p: Values, history: History) -> Array:
    """Stress [Pa] of a branch that has no equation in time: s_1 = 2 mu^(omega, e0) e_1, without mean and overtones.

    Args:
        modulus: complex modulus mu^ of the branch [Pa].
        p: parameter values by name.
        history: tensor shear strain e = gamma/2 over time [1], (..., n), with amplitude e0 and first harmonic e_1.

    >>> harmonic_stress(lambda p, omega, strain: 1.0, {}, History.steady(np.array([3.0, 2.0, -1.0, 0.0]), 1.0)).round(6)
    array([ 4.,  2., -4., -2.])
    """
    transfer = 2.0 * modulus(p, np.atleast_1d(history.omega), history.amplitude)
    return np.real(np.asarray(transfer) * history.fundamental)
