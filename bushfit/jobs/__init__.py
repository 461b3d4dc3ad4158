"""What the commands do, without a terminal: one path from a campaign to its result files, for one bushing or many.

A job is a frozen set of settings. It names the files it will write, and takes a campaign's data to an outcome; the
outcome knows its JSON documents and makes its files.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.fitting.data import Data
    from bushfit.model.result import Result

#: Format of the tables that a job makes besides its JSON documents.
TABLES = "csv"


class Outcome(Protocol):
    """What a job found."""

    @property
    def result(self) -> Result:
        """The model with its uncertainty."""

    @property
    def document(self) -> Mapping[str, Any]:
        """What `--json` prints."""

    def files(self, formats: Collection[str]) -> dict[str, bytes]:
        """Result files by name: the JSON documents, and the tables and plots that `formats` asks for."""


Found = TypeVar("Found", bound=Outcome, covariant=True)


class Job(Protocol[Found]):
    """Work on one campaign."""

    def names(self, campaign: Campaign, formats: Collection[str]) -> list[str]:
        """The files that the outcome will hold, known before the work."""

    def run(self, data: Data) -> Found:
        """The work.

        Raises:
            BushfitError: data or settings that cannot support it.
        """
