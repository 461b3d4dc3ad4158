"""The record that describes one mistake in what a file says, and the test as it was measured if it was made."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from bushfit.effects.contract import Effect, Level
from bushfit.geometry import Bushing, Direction, Motion, Place
from bushfit.reading.measurement import Complex, Loop, Sweep

_Test = TypeVar("_Test", bound=Loop | Sweep)


@dataclass(frozen=True, kw_only=True)
class Mistake(Effect):
    """What the record says is not what was measured.

    `sentence` is what would be so, with a slot for the files: "the amplitudes of {files} are peak-to-peak".

    Args:
        line: what to write into the campaign, or to correct where no key does it.
        sweep_line: the same for a sweep, where it differs.
        kinds: tests in which it is made, sweeps unless told; none for one that is made in [bushing].
        motion: of the tests in which it is made; None for any.
        displacement, force, time: true value over the one stated; `displacement` of the radii, where it is made there.
        stiffness: true complex stiffness by the one stated, (n,) each, for what the three factors cannot say; of a
            sweep only.
        doubt: whether a complex stiffness as stated leaves room for the mistake; None for always.
        swaps: whether the direction is another one.
    """

    level: Level = Level.RECORD
    parameters: tuple[()] = ()
    source: str = "usage in test laboratories"
    line: str
    sweep_line: str = ""
    kinds: tuple[Literal["sweep", "loop"], ...] = ("sweep",)
    motion: Motion | None = None
    displacement: float = 1.0
    force: float = 1.0
    time: float = 1.0
    stiffness: Callable[[Complex], Complex] | None = None
    doubt: Callable[[Complex], bool] | None = None
    swaps: bool = False

    def mended(self, test: _Test) -> _Test | None:
        """The test as it was measured if this mistake was made in it; None where it cannot have been made."""
        if not self.possible(test):
            return None
        direction = self._direction(test.direction)
        if isinstance(test, Loop):
            motion, force = self.displacement * test.displacement, self.force * test.force
            return replace(test, direction=direction, time=self.time * test.time, displacement=motion, force=force)
        return replace(
            test,
            direction=direction,
            amplitude=self.displacement * test.amplitude,
            reached=None if test.reached is None else self.displacement * test.reached,
            stiffness=self.force * (self.stiffness(test.stiffness) if self.stiffness else test.stiffness),
        )

    def mended_cycle(self, cycle: Sweep) -> Sweep:
        """The fundamental of a mended loop, from the fundamental of the loop as stated."""
        return replace(
            cycle,
            direction=self._direction(cycle.direction),
            frequency=cycle.frequency / self.time,
            amplitude=self.displacement * cycle.amplitude,
            stiffness=self.force / self.displacement * cycle.stiffness,
        )

    def possible(self, test: Loop | Sweep) -> bool:
        """Whether it can have been made in a test."""
        kind, place = "loop" if isinstance(test, Loop) else "sweep", test.direction
        fits = kind in self.kinds and self.motion in (None, place.motion)
        doubtful = self.doubt is None or (isinstance(test, Sweep) and self.doubt(test.stiffness))
        return fits and doubtful and not (self.swaps and other_direction(place) is None)

    def _direction(self, place: Place) -> Place:
        return (other_direction(place) if self.swaps else None) or place

    def mended_bushing(self, bushing: Bushing) -> Bushing:
        """The bushing as it is, if the mistake was made in its radii."""
        inner, outer = (self.displacement * radius for radius in (bushing.inner_radius, bushing.outer_radius))
        return replace(bushing, inner_radius=inner, outer_radius=outer)

    def corrected(self, test: Loop | Sweep | None) -> str:
        """What to write into the campaign for a test, or to correct in its file; None stands for the bushing."""
        if test is None:
            return self.line
        other = other_direction(test.direction) if self.swaps else None
        kind, line = ("loops", self.line) if isinstance(test, Loop) else ("sweeps", self.sweep_line or self.line)
        return f"[[{kind}]] of {shown(test)}: {line.replace('{direction}', str(other))}"


def told(mistake: Mistake, test: Loop | Sweep) -> str:
    """A mistake in one test, and the line for the campaign that puts it right, in words."""
    return f"{mistake.sentence.format(files=shown(test))} (then, in the campaign: {mistake.corrected(test)})"


def shown(test: Loop | Sweep) -> str:
    """The file of a test, or its name where it came from none."""
    return test.source.file.name if test.source else test.name


def other_direction(place: Place) -> Direction | None:
    """Radial for axial and the reverse; None for what cannot be taken for either."""
    if place is Direction.AXIAL:
        return Direction.RADIAL
    return Direction.AXIAL if place is Direction.RADIAL else None
