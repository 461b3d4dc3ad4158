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
    """Level at which an effect acts, from the rubber outward; predictions exclude instrument and record."""

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
        name: ASCII name, in files and reports `<effect>.<name>` except for the paper's effects.
        bounds: least and largest plausible value.
        unit: SI unit; "1" for a ratio.
        neutral: value at which the effect vanishes; None if another parameter has this value.
        typical: usual distance from the neutral value; scale of the parameter in a fit.
        meaning: description for users.
        log: True if a fit varies the logarithm of the (positive) parameter.
        scale: quantity of the tests that determines the start of a search: "period", "frequency", "displacement",
            "strain" or "force"; "session" for a share of its duration; "order" for the order of a derivative; None if
            `typical` suits all tests.
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
        """Value at a share of the typical distance from the neutral value, or from 0 without a neutral value.

        >>> Parameter("c3", "1", (0.0, 1e5), 0.0, 20.0, "cubic stress coefficient over mu").sized(0.5)
        10.0
        """
        return (self.neutral or 0.0) + share * self.typical


@dataclass(frozen=True, eq=False)
class Circumstances:
    """Temperature and history of a test; effects that depend on an unknown quantity (None) do nothing.

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
        """Circumstances of the operating points of an index; numbers apply to all points."""
        quantities = (self.temperature, self.turn, self.strained, self.left, self.rested)
        return Circumstances(*(value[points] if isinstance(value, np.ndarray) else value for value in quantities))


#: Unknown circumstances, as in a prediction.
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
    """Properties that all effects have.

    Args:
        name: name in files, reports and options, and of the file of its law.
        sentence: description for an engineer.
        equation: first-harmonic form, ASCII.
        level: level at which it acts.
        parameters: its parameters.
        source: literature.
        confirmed_by: simplest test that would confirm the effect.
        harmonic_error: relative error of the first-harmonic face compared with the time face; 0 if exact.
        settles: True if the response changes from cycle to cycle, so that all cycles of a loop are computed.
        corrects: direction or specimen whose stiffness formula it scales by a fitted factor, so that the error of the
            formula needs no warning; None for other effects.
        twins: effects with the same equation in all tests, mostly of the rig. The effect of the bushing, which lists
            the twins, is proposed; the tests determine its size but cannot distinguish it from its twins.
        replaces: branch of the paper that it replaces; None if it is added.
        under: quantities of `Circumstances` that it depends on.
        assumption: sentence on the value of these quantities in a prediction; empty for effects of the rig.
        in_place_of: of an effect that replaces a branch, start values of a fit from the values of that branch, the most
            probable first.
        harmonic_only: True if it has no law in time: in loops it contributes to the first harmonic alone (see
            `harmonic_response`), and the virtual rig refuses it.
        after: effect that must be in the model before this effect is searched.
        never_with: effects beside which this effect is not searched, because both together fit any law.
        limit: simpler effect that it becomes at the end of its range; None without such a limit.
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
        """Part of the sentence before the first colon or semicolon, for use within another sentence."""
        short = re.split("[:;]", self.sentence.rstrip("."))[0]
        return short[0].lower() + short[1:]

    def acts_at(self, place: Place) -> bool:
        """Return True if the effect acts in a direction or specimen; the name restricts it to one."""
        return self.name.partition(".")[2] in ("", str(place))

    @property
    def amount(self) -> Parameter:
        """First parameter with a neutral value; a search varies this parameter."""
        return next(parameter for parameter in self.parameters if parameter.neutral is not None)


@dataclass(frozen=True, kw_only=True)
class Branch(Effect):
    """Stress of the material in parallel with the other branches.

    Args:
        modulus: (values, omega [rad/s], strain amplitude) -> complex modulus s~ / (2 e~) of the first harmonic [Pa].
        stress: (values, strain history) -> stress [Pa].
        modulus_sensitivities: derivatives of the modulus by its own parameters; None for numerical derivatives.
        stress_sensitivities: derivatives of the stress by its own parameters; None for numerical derivatives.
        uses: parameters of the paper that it reads.
        size: parameter that the modulus of a linear viscoelastic branch is proportional to, so that Maxwell arms can
            replace the branch; None for other branches.
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
    """Change of the parameter values of other effects, by operating condition.

    Args:
        adjust: (values, condition) -> the changed values only.
        shift_factor: (values, circumstances) -> time-temperature shift factor a_T; None without a shift.
    """

    level: Level = Level.MATERIAL
    adjust: Callable[[Values, Condition], dict[str, Value]]
    shift_factor: Callable[[Values, Circumstances], Value] | None = None


@dataclass(frozen=True, kw_only=True)
class Layer(Effect):
    """Layer around the response of the rubber and of the layers below it.

    Args:
        turns: True if it also acts in torsion.
        adds: parameter that adds up over neighbouring layers of the same law, such as compliances in series.
        stiffness: (values, response below, omega [rad/s], amplitude [m or rad], setting) -> complex stiffness above.
        force: (values, force below, displacement history, setting) -> force above [N or N m].
    """

    turns: bool = True
    adds: str | None = None
    stiffness: Callable[[Values, StiffnessBelow, Array, Array, Setting], Array]
    force: Callable[[Values, ForceBelow, History, Setting], Array]


@dataclass(frozen=True, eq=False)
class Family:
    """Effects of the same law, one for each direction or specimen.

    Args:
        record: effect with the placeholder {place} in its texts. The effect of a place acts there alone; the effect and
            its one parameter are named `<name>.<place>`.
        places: selects the places of a search from the tested places.
        radial: texts for the radial direction that differ from those of the record.
    """

    record: Effect
    places: Callable[[Sequence[str]], Sequence[str]]
    radial: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Name without the place."""
        return self.record.name.partition(".")[0]

    @cache  # noqa: B019  # the families live as long as the program
    def of_place(self, place: str) -> Effect:
        """Effect of one place; cached."""
        record = replace(self.record, **(self.radial if place == Direction.RADIAL else {}))
        values = {member.name: getattr(record, member.name) for member in fields(record)}
        texts: dict[str, Any] = {key: text.format(place=place) for key, text in values.items() if isinstance(text, str)}
        parameters = tuple(replace(one, meaning=one.meaning.format(place=place)) for one in record.parameters)
        twins = tuple(twin.format(place=place) for twin in record.twins)
        return replace(record, **texts, parameters=parameters, twins=twins)


def scaled_values(p: Values, names: tuple[str, ...], factor: Value) -> dict[str, Value]:
    """Multiply values by a factor, as most modifiers do.

    Args:
        p: parameter values.
        names: of the values to multiply; names without a value are ignored.
        factor: number, or array that broadcasts against operating points.

    Returns:
        The changed values.

    >>> scaled_values({"mu": 1e6}, ("mu", "m"), 0.5)
    {'mu': 500000.0}
    """
    return {name: p[name] * factor for name in names if name in p}


def scaled_response(
    factor: Callable[[Values, Setting], Value], p: Values, below: Callable[..., Array], *motion_and_setting: Any
) -> Array:
    """Response below a layer times a factor; the same for stiffness and force.

    Args:
        factor: (values, setting) -> factor.
        p: parameter values of the layer.
        below: response below the layer.
        motion_and_setting: omega and amplitude, or history; then the setting.
    """
    *motion, setting = motion_and_setting
    return factor(p, setting) * below(*motion)


def linear_stress(modulus: Callable[[Values, Array, Array], Array], p: Values, history: History) -> Array:
    """Steady stress of a linear branch over one cycle: s_h = 2 mu^(h omega) e_h for every harmonic h.

    Args:
        modulus: of the branch; it must be finite at omega = 0, where it multiplies the mean strain.
        p: parameter values.
        history: a steady cycle of the strain.
    """
    return history.response(lambda omega: 2.0 * modulus(p, omega, history.amplitude))


def harmonic_response(transfer: Value, history: History) -> Array:
    """Response of an effect without a law in time: complex ratio times the first harmonic of the motion.

    Args:
        transfer: stress over strain (2 mu^) or force over displacement (K), (..., 1).

    >>> harmonic_response(2.0, History.steady(np.array([3.0, 2.0, -1.0, 0.0]), 1.0)).round(6)
    array([ 4.,  2., -4., -2.])
    """
    return np.real(np.asarray(transfer) * history.fundamental)


def harmonic_stress(modulus: Callable[[Values, Array, Array], Array], p: Values, history: History) -> Array:
    """Stress of a branch without a law in time: s_1 = 2 mu^(omega, e0) e_1, without mean and overtones.

    Args:
        modulus: of the branch.
        p: parameter values.
        history: strain over time.
    """
    return harmonic_response(2.0 * modulus(p, np.atleast_1d(history.omega), history.amplitude), history)
