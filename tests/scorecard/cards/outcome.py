"""What a task of the score card is, and what the workflow said of it beside the truth."""

from dataclasses import dataclass
from typing import Literal

from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.effects import LIBRARY, twins_of
from cards.hidden import Sealed

#: The verdict of the reader, where it does not take a file with a mistake.
REFUSED = "refused"
#: Names in a set at most, for the truth in it to count as named.
_LARGEST_SET = 3
#: Verdicts under which every name stays in the model.
_KEEPING = ("named", "partly")
#: Kinds of campaigns in which nothing is hidden.
CLEAN = ("clean", "awkward")

#: What came of the planned session: one true name for each set, a wrong name, no name; or the plan knows of no test.
Settled = Literal["rightly", "wrongly", "open", "elsewhere"]


@dataclass(frozen=True)
class Task:
    """One hidden campaign to make and to diagnose.

    Args:
        kind: of campaign.
        seed: of everything random in it.
        hidden: effects; of a kind "mistake" the mistake.
        outside: what the library does not have; the name of a recipe, where the campaign is made by one.
        without: effects that the library is made to lack.
    """

    kind: str
    seed: int
    hidden: tuple[str, ...]
    outside: str = ""
    without: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What the workflow said of one campaign, and the truth.

    Args:
        task: what was hidden.
        sealed: the truth; None where the campaign could not be made.
        verdict: of the diagnosis; "refused" where the reader does not take the file, "failed" where it went wrong.
        sets: all members of each set, leader first; of a name alone that.
        gain: chi-square that the best single effect takes off, whether it was added or not.
        heldout: gap on held-out data after, in units of noise; None where nothing was held out.
        covered: per hidden effect that was added: whether the 95 % interval of its amount holds the truth.
        seconds: processor time of the diagnosis, whatever else the machine does.
        matters: of a mistake, whether it leaves more than the tolerance for a plain model, and more than 2 % of |K| or
            of a parameter.
        error: what went wrong, or "".
        before: gap on held-out data before, as `heldout`.
        settled: what came of the planned session, where effects of the library were left open and it was asked for.
        decides: the test on the rig that is asked for, where the virtual rig can make none that decides.
        nothing: probability told of nothing; None where there is no diagnosis.
        leader: what was told as likeliest, by the names of its parts; "" where nothing was.
        odds: probability told of the leader, if anything is missing.
    """

    task: Task
    sealed: Sealed | None
    verdict: str
    sets: tuple[tuple[str, ...], ...] = ()
    gain: float = 0.0
    heldout: float | None = None
    covered: tuple[bool, ...] = ()
    seconds: float = 0.0
    matters: bool = False
    error: str = ""
    before: float | None = None
    settled: Settled | None = None
    decides: str = ""
    nothing: float | None = None
    leader: str = ""
    odds: float = 0.0

    @property
    def named(self) -> tuple[str, ...]:
        """What it named or what leads a set."""
        return tuple(members[0] for members in self.sets)

    @property
    def seen(self) -> bool:
        """Whether anything was said to be missing at all."""
        return self.verdict != "consistent"

    @property
    def shows(self) -> bool:
        """Whether there is more to see than the tolerance."""
        if self.task.kind == "mistake":
            return self.matters
        return (
            self.task.kind not in CLEAN
            and self.sealed is not None
            and self.sealed.visible > DiagnosisSettings().tolerance
        )

    @property
    def leader_right(self) -> bool | None:
        """Whether what was told as likeliest is so, all of it and nothing else; None where it tells of a place, or of
        what has no name, and something is hidden that may be just that."""
        parts = self.leader.split(" + ")
        names = [part for part in parts if " " not in part]
        if self.task.kind in CLEAN or any(not self._is_true(name, *twins_of(name)) for name in names):
            return False
        if len(names) < len(parts):
            return None if self.task.outside or self.task.without else False
        told = {alike for name in names for alike in twins_of(name)}
        hidden = self.sealed.hidden if self.sealed and self.task.hidden else ()
        return all({*twins_of(name), _limit(name)} & told for name in hidden)

    @property
    def left_open(self) -> bool:
        """Whether look-alikes are left, or an effect whose level the rig has a twin of."""
        return self.verdict == "ambiguous" or (self.verdict in _KEEPING and any(twins for _, twins in self._claims))

    @property
    def settles(self) -> Settled:
        """Whether this diagnosis, made with further tests, leaves one true name of each set of look-alikes."""
        if self.wrong_kept:
            return "wrongly"
        alone = all(len(members) == 1 for members in self.sets)
        return "rightly" if self.verdict in _KEEPING and alone else "open"

    @property
    def truths(self) -> set[str]:
        """All names that say what was done, with the simpler ones that these are at an end of their range."""
        done = {*self.task.hidden, *(self.sealed.hidden if self.sealed else ())}
        return done | {limit for name in done if (limit := _limit(name))}

    def _is_true(self, *names: str) -> bool:
        """Whether one of the names says what was done; a family that is no effect itself says it for all its places."""
        families = self.truths - LIBRARY.keys()
        return any(name in self.truths or name.partition(".")[0] in families for name in names)

    @property
    def _claims(self) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
        """Each set with the names that the same data give its members at other levels."""
        return [(names, tuple({twin for name in names for twin in twins_of(name)} - {*names})) for names in self.sets]

    @property
    def truth_in_sets(self) -> bool:
        """Whether every hidden effect was named alone, or as a twin, or in a set of at most three."""
        told = {name for members, twins in self._claims if len(members) <= _LARGEST_SET for name in (*members, *twins)}
        return all({name, _limit(name)} & told for name in self.task.hidden)

    @property
    def wrong_kept(self) -> tuple[str, ...]:
        """Names that stay in the model, under whatever verdict, and are not the truth, a twin or a limit of it."""
        return tuple(
            members[0]
            for members, twins in self._claims
            if (self.verdict in _KEEPING or (self.verdict == "ambiguous" and len(members) == 1))
            and not self._is_true(members[0], *twins)
        )

    @property
    def wrong_set(self) -> bool:
        """Whether a set of look-alikes was given that the truth is not in."""
        return self.verdict == "ambiguous" and any(
            len(members) > 1 and not self._is_true(*members, *twins) for members, twins in self._claims
        )

    @property
    def halved(self) -> bool:
        """Whether the excess of the held-out gap over the noise is at least halved."""
        if self.before is None or self.heldout is None:
            return False
        return self.heldout - 1.0 <= 0.5 * (self.before - 1.0)

    @property
    def mistake_told(self) -> bool:
        """Whether the mistake, in the tests in which it was made, was named, stands in a set of at most three, or had
        its file refused by the reader."""
        hidden = set(self.sealed.hidden) if self.sealed else set()
        claims = [set(self.named), *(set(other.split(" + ")) for members in self.sets for other in members[1:])]
        small = all(len(members) <= _LARGEST_SET for members in self.sets)
        return self.verdict == REFUSED or (hidden in claims and small)

    @property
    def mistake_alone(self) -> bool:
        """Whether the mistake alone was named, in just the tests in which it was made."""
        return self.verdict == "named" and self.sealed is not None and set(self.named) == set(self.sealed.hidden)

    @property
    def single_wrong(self) -> bool:
        """A confident name (verdict named) that is neither the truth nor said to be a limit of it."""
        return self.verdict == "named" and bool(self.wrong_kept)

    @property
    def exact(self) -> bool:
        """Exactly the hidden effects named, each alone."""
        return self.verdict == "named" and set(self.named) == set(self.task.hidden)


def _limit(name: str) -> str | None:
    """The simpler effect that one is at an end of its range."""
    return LIBRARY[name].limit if name in LIBRARY else None
