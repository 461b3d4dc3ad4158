"""The verdict: look-alikes are a set, twins leave the level open, what cannot be shown is said; and the next test.

That is an entry of the menu that parts the models in question, and none where there is nothing to part.
"""

from dataclasses import replace

import numpy as np
import pytest
from rigged import SHARED, asked, no_repeats, said

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.next_test import BUSHING_TESTS, FIXTURE_TESTS, deciding_test, remaining_entropy
from bushfit.effects import BASE
from bushfit.fitting.preparation import MeasuredTest, planned_sweep
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Direction, Specimen
from bushfit.model.model import Model


def test_the_class_of_a_rig_that_is_assumed_is_said(measured):
    campaign = no_repeats(measured({}, SHARED))
    for rig, words in (
        (RigSettings(), "0.5 % gain and 0.25 deg phase, gain and phase assumed"),
        (RigSettings(gain_error=4e-3), "0.4 % gain and 0.25 deg phase, phase assumed"),
        (RigSettings(gain_error=4e-3, phase_error=3.5e-3), ""),
    ):
        assumed = PreparedCampaign.from_campaign(replace(campaign, rig=rig)).assumed
        assert [note.partition(" class of the rig, ")[2] for note in assumed] == [words] * bool(words)


#: 3 % of give in the axial direction, 17 % in the radial, measured at a few frequencies.
SOFT_RIG = {"rig_compliance": {"compliance": 4e-8}}
FEW = tuple(replace(sweep, frequencies=(5.0, 25.0, 55.0, 85.0, 115.0, 155.0)) for sweep in SHARED.sweeps)
#: With torsion, in which nothing gives way along a line: it tells the rubber by itself.
TURNED = replace(SHARED, sweeps=(*FEW, replace(FEW[0], direction=Direction.TORSION, amplitudes=(0.01, 0.03))))


@pytest.mark.slow
def test_compliance_in_one_direction_alone_is_never_a_bold_name(measured):
    """A softer rig and a softer rubber look alike in one direction; two leave open which gives way, torsion tells."""
    campaign = measured(SOFT_RIG, TURNED)
    whole = asked(campaign)
    assert said(whole) == "named sleeve_compliance"
    assert said(asked(replace(campaign, sweeps=campaign.sweeps[:2]))) == (
        "ambiguous sleeve_compliance|sleeve_compliance.radial"
    )
    assert whole.result.unresolved == ("sleeve_compliance",)
    (entry,) = whole.to_document()["effects"]
    assert (entry["level"], entry["twins"]) == ("unresolved", ["rig_compliance"])
    low, high = whole.result.interval("sleeve_compliance.compliance") or (0.0, 0.0)
    assert low <= 4e-8 <= high
    for alone in (
        replace(campaign, sweeps=campaign.sweeps[:1]),
        replace(campaign, sweeps=campaign.sweeps[1:2], loops=()),
    ):
        assert asked(alone).verdict in ("consistent", "ambiguous")
    again = asked(campaign, whole.result.model, unresolved=whole.result.unresolved)
    assert (again.verdict, again.result.unresolved) == ("consistent", ("sleeve_compliance",))
    settled = asked(campaign, whole.result.model, unresolved=whole.result.unresolved, adopt=("rig_compliance",))
    assert (settled.verdict, settled.result.unresolved) == ("consistent", ())
    assert settled.result.model.effects == (*BASE, "rig_compliance")
    assert settled.result.model.values["rig_compliance.compliance"] == pytest.approx(
        whole.result.model.values["sleeve_compliance.compliance"], rel=1e-3
    )
    proposed = {decide_verdict.name for decide_verdict in settled.candidates}
    assert not proposed & {"sleeve_compliance", "rig_compliance"}


SENTENCES = [test.sentence for test in BUSHING_TESTS]
SENTENCES += [test.sentence.format(place=place) for test in FIXTURE_TESTS for place in ("axial", "radial")]
EVEN = (0.5, 0.5)


@pytest.fixture
def data_sets(measured) -> list[MeasuredTest]:
    data = PreparedCampaign.from_campaign(measured())
    return [*data.loops, *data.sweeps]


def with_each(model: Model, *effects: dict[str, float]) -> list[Model]:
    """The model with one effect more, each in turn, by the values of its parameters."""
    return [model.with_effect(next(iter(values)).partition(".")[0], values) for values in effects]


SLIP = {"interface_slip.force": 2.0}
SECOND = {"second_friction.sigma_fmax": 2e3, "second_friction.eps_half": 5e-4}
STOP = {"bump_stop.gap": 4e-4, "bump_stop.stiffness": 1e5}


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ({"rig_compliance.compliance": 1e-7}, STOP, ("fixture", "dummy")),
        ({"inertia.mass": 0.03}, {"viscous.eta": 60.0}, ("fixture", "highest frequency")),
        ({"viscous.eta": 60.0}, {"maxwell.mu1": 1e5, "maxwell.tau": 6e-4}, ("highest frequency",)),
        ({"strain_stiffening.c3": 0.5}, {"bump_stop.gap": 4.5e-4, "bump_stop.stiffness": 2e3}, ("largest amplitude",)),
        (SLIP, SECOND, ("smallest",)),
        ({"interface_slip.force": 0.4}, {"viscous.eta": 8.0}, ("smallest",)),  # where slip by far outweighs the rest
    ],
    ids=lambda value: next(iter(value)).partition(".")[0] if isinstance(value, dict) else "",
)
def test_pairs(paper_model, data_sets, one, other, words):
    models = with_each(paper_model, one, other)
    found = deciding_test(models, EVEN, data_sets)
    assert found in SENTENCES
    assert any(word in found for word in words)
    assert deciding_test(models[::-1], EVEN, data_sets) == found


def test_the_next_test_is_within_the_limits_of_the_rig(paper_model, data_sets):
    models = with_each(paper_model, {"viscous.eta": 60.0}, {"maxwell.mu1": 1e5, "maxwell.tau": 6e-4})
    top = max(float(data_set.frequency.max()) for data_set in data_sets)
    assert "highest frequency" in deciding_test(models, EVEN, data_sets)
    assert "highest frequency" not in deciding_test(models, EVEN, data_sets, RigSettings(max_frequency=top))


@pytest.mark.parametrize("odds", [(1.0, 1.0), (0.8, 0.2)])
def test_what_stays_open_is_bounded_from_above(odds):
    """Against the entropy that is left of two normal distributions a distance apart, by integration."""
    p, x = np.array(odds) / sum(odds), np.linspace(-12.0, 20.0, 20_001)
    for distance in (0.0, 0.5, 3.0, 8.0):
        weighed = p[:, None] * np.exp(-0.5 * np.square(x - np.array([[0.0], [distance]]))) / np.sqrt(2.0 * np.pi)
        share = weighed / weighed.sum(axis=0)
        left = -float(np.trapezoid((weighed * np.log(np.maximum(share, 1e-300))).sum(axis=0), x))
        bound = float(remaining_entropy(odds, distance**2 * (1.0 - np.eye(2))))
        assert left - 1e-6 <= bound <= left + 0.2
    assert remaining_entropy(odds, np.zeros((2, 2))) == pytest.approx(-float(p @ np.log(p)))
    far = [float(remaining_entropy((*odds, 0.0), d * (1.0 - np.eye(3)))) for d in (300.0, 1000.0, 3000.0)]
    assert far[0] > far[1] > far[2] > 0.0, "no rounding stands in for what is left"


@pytest.mark.parametrize("bushing", [True, False])
def test_coupons_with_a_bushing_are_followed_by_a_sweep_of_it(bushing, paper_model):
    """A bushing that was not tested is proposed, and no test of a bushing if the campaign has none."""
    model = paper_model if bushing else replace(paper_model, bushing=None)
    coupon = Specimen("DMA", "modulus")
    sweep = planned_sweep(model, coupon, np.array([5.0, 25.0, 105.0]), np.full(3, 0.01), (2e-3, 2e-3), (2e-3, 2e-3))
    rivals = [model, model.with_effect("stiffness_factor.radial", {"stiffness_factor.radial": 1.2})]
    assert ("radial direction" in deciding_test(rivals, EVEN, [sweep])) == bushing
