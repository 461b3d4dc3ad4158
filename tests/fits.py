"""The joint fit of a campaign, as most tests need it."""

from typing import Any

from bushfit.campaign.campaign import Campaign
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint
from bushfit.model.result import Result


def joint_fit(campaign: Campaign, **options: Any) -> Result:
    """The five parameters, or those of the campaign's effects, fitted to its tests at once."""
    return fit_joint(PreparedCampaign.from_campaign(campaign), **options)
