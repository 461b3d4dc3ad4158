"""The record that describes one effect, in one of three kinds: branch, modifier or layer.

The measured response is built from the rubber outward. Inside are *branches* in parallel, each adding a stress.
Around them lie *layers*: each takes the response below it and returns the response above it. A *modifier* changes
values that the branches use, by operating condition, and is asked before them. Layers are ordered by level (material,
component, instrument), never by the order in which they were added.

Each effect answers in two ways: as complex stiffness over frequency and amplitude (the frequency face), and as force
over time (the time face).

Notes:
    Every face broadcasts. The last axis holds operating points (frequency face) or samples (time face). Parameter
    values are numbers, or arrays whose last axis has length 1: a Jacobian by differences or a bootstrap is then one
    call with the values along a leading axis.

    In the examples of the laws `paper` is the model of the paper's bushing, `spring` the response below a layer, of 500
    N/mm, and `sweep` and `loop` are axial tests of that bushing.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bushfit.effects.history import Array as Array
from bushfit.effects.history import History as History
from bushfit.geometry import Bushing, Direction, Place

if TYPE_CHECKING:
    from bushfit.effects.unnamed import Unnamed

#: Frequency [Hz] and strain amplitude [1] at which laws compare: within the range of most tests.
REFERENCE_FREQUENCY = 25.0
REFERENCE_STRAIN = 0.01

#: A number, or an array that broadcasts against operating points or samples.
Value = Any
#: Parameter values by name.
Values = Mapping[str, Value]
#: Force [N or N m] that answers a displacement history.
ForceBelow = Callable[[History], Array]


@dataclass(frozen=True)
class StiffnessBelow:
    """The response below a layer in the frequency face.

    Args:
        stiffness: (omega [rad/s], amplitude [m or rad]) -> complex dynamic stiffness.
        cycle: (omega, one steady cycle of motion per operating point, (..., n, samples), which of the test's operating
            points these are, as an index) -> force of the same shape, for the layers that bend the waveform.
    """

    stiffness: Callable[[Array, Array], Array]
    cycle: Callable[[Array, Array, Any], Array]

    def __call__(self, omega: Array, amplitude: Array) -> Array:
        return self.stiffness(omega, amplitude)


class Level(IntEnum):
    """Where an effect acts, from the rubber outward. Prediction leaves the instrument out; a record is no model."""

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
        name: ASCII name; base effects use it as it is, added effects as `<effect>.<name>`.
        bounds: what a rubber, a bushing or a rig can have.
        neutral: the value at which the effect vanishes; None where another parameter does that.
        typical: a usual distance from the neutral value; the scale on which a fit moves a linear parameter.
        log: whether a fit moves its logarithm (strictly positive parameters).
        scale: what of the tests its size goes with, so that a search knows where to start: "period",
            "frequency", "displacement", "strain" or "force"; "session" for a share of its duration; "order" where
            it is one of derivation, of which there is but one range; none where `typical` is good for any test.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    neutral: float | None
    typical: float
    meaning: str
    log: bool = False
    scale: Literal["period", "frequency", "displacement", "strain", "force", "order", "session"] | None = None

    def sized(self, share: float) -> float:
        """The value at a share of the typical distance from the neutral one, or from 0 where none is neutral.

        >>> Parameter("c3", "1", (0.0, 1e5), 0.0, 20.0, "cubic stress coefficient over mu").sized(0.5)
        10.0
        """
        return (self.neutral or 0.0) + share * self.typical


@dataclass(frozen=True, eq=False)
class Circumstances:
    """Temperature and history of a test; what is not known is None, and effects that depend on it then do nothing.

    Args:
        temperature: of the rubber [K], a number or one per operating point, (n,).
        turn: when in the session a point was measured, from 0 for the first to 1 for the last; a number or (n,), as all
            that follows.
        strained: largest strain amplitude that the rubber had seen before [1].
        left: last strain amplitude before that was larger than the point's [1]; 0 where none was.
        rested: turns since then.
    """

    temperature: Array | float | None = None
    turn: Array | float | None = None
    strained: Array | float | None = None
    left: Array | float | None = None
    rested: Array | float | None = None

    def select(self, points: Any) -> Circumstances:
        """The circumstances of some operating points, by an index; numbers stay."""
        known = (self.temperature, self.turn, self.strained, self.left, self.rested)
        return Circumstances(*(each[points] if isinstance(each, np.ndarray) else each for each in known))


#: Circumstances of which nothing is known: those of a prediction.
UNKNOWN = Circumstances()


@dataclass(frozen=True)
class Setting:
    """The test that a response belongs to.

    Args:
        bushing: on whose rig the test is made; None where specimens alone are tested.
        direction: of the motion, or the specimen under test.
        kind: of the test: some effects belong to the rig that makes one of the two.
        under: what it was made under.
        unnamed: the data of the model's effect of that name.
    """

    bushing: Bushing | None
    direction: Place
    kind: Literal["sweep", "loop"]
    under: Circumstances = UNKNOWN
    unnamed: Unnamed | None = None


@dataclass(frozen=True)
class Condition:
    """The operating condition that a modifier may depend on.

    Args:
        omega: angular frequency [rad/s].
        amplitude, strain: of the displacement [m or rad], and the equivalent strain amplitude [1].
        stiffness: complex stiffness of the bushing [N/m or N m/rad] by parameter values.
        moduli: names of the rubber's moduli and stresses, which go up and down together with its stiffness.
    """

    setting: Setting
    omega: Array
    amplitude: Array
    strain: Array
    stiffness: Callable[[Values], Array]
    moduli: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What every effect states about itself.

    Args:
        name: the name in files, reports and options; the file of its law is called so.
        sentence: what it is, for an engineer.
        equation: its first-harmonic form, ASCII.
        source: where the law comes from.
        confirmed_by: the cheapest test that would prove it.
        harmonic_error: relative error of the first-harmonic face against the time face; 0 where exact.
        settles: whether the response changes from cycle to cycle, so that a loop is followed through all its cycles.
        corrects: the direction, or specimen, whose stiffness formula it scales by a fitted factor; where the effect is
            in a model, that formula's own error needs no warning. None where it scales no formula.
        twins: names of effects, of the rig above all, with the same equation for all tests. Of such twins the one that
            belongs to the bushing, which is this one, is proposed; how large it is, is then known, which it is, not.
        replaces: the branch of the paper that it stands in place of; None where it is added to the others.
        under: what of a test's circumstances it depends on, by the names of `Circumstances`.
        assumption: what a prediction takes of these where they are not known, for its user; none of the rig's effects.
        in_place_of: of one that replaces a branch, where a fit may begin, the likeliest first: its values by those of
            that branch.
        harmonic_only: whether it has no law in time: of a loop it answers the first harmonic alone, by
            `harmonic_response`, and the rig refuses it.
        after: the effect without which it is no other: it is looked for beside that one only.
        never_with: effects beside which it is not looked for: the two together are a series that follows any law
            between them, and so no name.
        limit: the simpler effect that it is at the end of its range; None where it has none.
    """

    name: str
    sentence: str
    equation: str
    level: Level
    parameters: tuple[Parameter, ...]
    source: str
    confirmed_by: str = ""
    harmonic_error: float = 0.0
    settles: bool = False
    corrects: str | None = None
    twins: tuple[str, ...] = ()
    replaces: str | None = None
    under: tuple[Literal["temperature", "turn", "strained", "left", "rested"], ...] = ()
    assumption: str = ""
    harmonic_only: bool = False
    in_place_of: Callable[[Values], list[dict[str, float]]] | None = None
    after: str | None = None
    never_with: tuple[str, ...] = ()
    limit: str | None = None

    @property
    def phrase(self) -> str:
        """Its sentence up to the first colon or semicolon, to stand within another."""
        short = re.split("[:;]", self.sentence.rstrip("."))[0]
        return short[0].lower() + short[1:]

    def acts_at(self, place: Place) -> bool:
        """Whether it acts at a place: one that belongs to a place, by its name, acts there alone."""
        return self.name.partition(".")[2] in ("", str(place))

    @property
    def amount(self) -> Parameter:
        """The parameter that the effect is searched by: the first that has a neutral value, where it vanishes."""
        return next(parameter for parameter in self.parameters if parameter.neutral is not None)


@dataclass(frozen=True, kw_only=True)
class Branch(Effect):
    """A stress in parallel with the others, of the material.

    Args:
        modulus: (values, omega [rad/s], strain amplitude) -> complex modulus s~ / (2 e~) of the first harmonic [Pa].
        stress: (values, strain history) -> stress [Pa].
        modulus_sensitivities: derivative of the modulus by each of its own parameters; where there is none, the model
            differentiates numerically.
        stress_sensitivities: the same of the stress.
        uses: the paper's parameters that it reads besides its own.
        size: of a linear branch that fades with memory, the parameter that its modulus is proportional to; Maxwell arms
            can stand for it. None for all others.
    """

    level: Level = Level.MATERIAL
    modulus: Callable[[Values, Array, Array], Array]
    stress: Callable[[Values, History], Array]
    modulus_sensitivities: Callable[[Values, Array, Array], dict[str, Array]] | None = None
    stress_sensitivities: Callable[[Values, History], dict[str, Array]] | None = None
    uses: tuple[str, ...] = ()
    size: str | None = None


@dataclass(frozen=True, kw_only=True)
class Modifier(Effect):
    """Changes values that other effects use, by operating condition; of the material unless it says otherwise.

    Args:
        adjust: (values, condition) -> the changed values only.
        shift_factor: (values, circumstances) -> how many times as fast a motion is on the rubber's own time scale, a_T;
            1 without.
    """

    level: Level = Level.MATERIAL
    adjust: Callable[[Values, Condition], dict[str, Value]]
    shift_factor: Callable[[Values, Circumstances], Value] | None = None


@dataclass(frozen=True, kw_only=True)
class Layer(Effect):
    """Wraps the response below it, in both faces alike.

    Args:
        turns: whether it acts in torsion too; else only on motion along a line.
        adds: the parameter whose sum stands for neighbours of the same law, such as compliances in series.
        stiffness: (values, response below, omega [rad/s], amplitude [m or rad], setting) -> complex stiffness above.
        force: (values, force below, displacement history, setting) -> force above [N or N m].
    """

    turns: bool = True
    adds: str | None = None
    stiffness: Callable[[Values, StiffnessBelow, Array, Array, Setting], Array]
    force: Callable[[Values, ForceBelow, History, Setting], Array]


@dataclass(frozen=True, eq=False)
class Family:
    """A kind of effect of which each place, a direction of the bushing or a specimen, may have its own.

    Args:
        record: of any place, in whose texts the place stands for {place}. An effect of the kind, which acts at its
            place alone, and its one parameter are called `<name>.<place>`.
        places: of the places tested, that by which the moduli go first, those that a search gives one.
        radial: texts that are others for the radial direction.
    """

    record: Effect
    places: Callable[[Sequence[str]], Sequence[str]]
    radial: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Of the kind."""
        return self.record.name.partition(".")[0]

    @cache  # noqa: B019  # the families live as long as the program
    def of_place(self, place: str) -> Effect:
        """The effect of one place, kept from one call to the next."""
        record = replace(self.record, **(self.radial if place == Direction.RADIAL else {}))
        named = {each.name: getattr(record, each.name) for each in fields(record)}
        texts: dict[str, Any] = {key: text.format(place=place) for key, text in named.items() if isinstance(text, str)}
        parameters = tuple(replace(each, meaning=each.meaning.format(place=place)) for each in record.parameters)
        twins = tuple(twin.format(place=place) for twin in record.twins)
        return replace(record, **texts, parameters=parameters, twins=twins)


def scaled_values(p: Values, names: tuple[str, ...], factor: Value) -> dict[str, Value]:
    """The named values times a factor, as far as the model has them: what most modifiers return.

    >>> scaled_values({"mu": 1e6}, ("mu", "m"), 0.5)
    {'mu': 500000.0}
    """
    return {name: p[name] * factor for name in names if name in p}


def scaled_response(
    factor: Callable[[Values, Setting], Value], p: Values, below: Callable[..., Array], *motion_and_setting: Any
) -> Array:
    """The response below a layer, stiffness or force alike, times a factor by values and test."""
    *motion, setting = motion_and_setting
    return factor(p, setting) * below(*motion)


def linear_stress(modulus: Callable[[Values, Array, Array], Array], p: Values, history: History) -> Array:
    """Steady stress of a linear branch over one cycle: s_h = 2 mu^(h omega) e_h for every harmonic h.

    The modulus at omega = 0 must be finite; it multiplies the mean strain.
    """
    return history.response(lambda omega: 2.0 * modulus(p, omega, history.amplitude))


def harmonic_response(transfer: Value, history: History) -> Array:
    """What an effect without a law in time answers: its complex ratio times the first harmonic of the motion, no more.

    It is the steady answer, from the first sample on.

    Args:
        transfer: stress over strain (2 mu^) or force over displacement (K), (..., 1).

    >>> harmonic_response(2.0, History.steady(np.array([3.0, 2.0, -1.0, 0.0]), 1.0)).round(6)
    array([ 4.,  2., -4., -2.])
    """
    return np.real(np.asarray(transfer) * history.fundamental)


def harmonic_stress(modulus: Callable[[Values, Array, Array], Array], p: Values, history: History) -> Array:
    """Stress of a branch without a law in time: s_1 = 2 mu^(omega, e0) e_1, no mean and no overtones."""
    return harmonic_response(2.0 * modulus(p, np.atleast_1d(history.omega), history.amplitude), history)
