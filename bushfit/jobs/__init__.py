"""What the commands do, without a terminal: one path from a campaign to its result files, for one bushing or many.

A job is a frozen set of settings. It names the files it will write, and takes a campaign's data to an outcome; the
outcome knows its JSON documents and makes its files.
"""

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

from bushfit.campaign.campaign import Campaign
from bushfit.fitting.data import Data
from bushfit.model.result import Result
from bushfit.report.contents import Contents, Kinds


class Outcome(Protocol):
    """What a job found."""

    @property
    def result(self) -> Result:
        """The model with its uncertainty."""

    @property
    def document(self) -> Mapping[str, Any]:
        """What `--json` prints."""

    @property
    def contents(self) -> Contents:
        """All that is written of it: documents, tables and pictures."""


Found = TypeVar("Found", bound=Outcome, covariant=True)


class Job(Protocol[Found]):
    """Work on one campaign."""

    def kinds(self, campaign: Campaign) -> Kinds:
        """The names of all that the outcome will hold, known before the work."""

    def run(self, data: Data) -> Found:
        """The work.

        Raises:
            BushfitError: data or settings that cannot support it.
        """
