"""What an FMU holds, whom it lets in, and what is said or refused instead."""

import importlib.util
import io
import re
import sys
import zipfile
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmus import LEVELS, Running, request_of, wandering, written

from bushfit.effects import LIBRARY, Level
from bushfit.errors import ModelError, OutputError
from bushfit.export.contract import Exported
from bushfit.export.fmu import export
from bushfit.export.in_time import time_model
from bushfit.geometry import Direction, Specimen
from bushfit.model.model import Model

#: The functions of FMI 2.0 that a slave has to export (version 2.0.4, sections 2.1 and 4.2).
FUNCTIONS = {
    f"fmi2{name}{kind}"
    for names, kinds in (
        (("Get", "Set"), ("Real", "Integer", "Boolean", "String", "FMUstate")),
        (("Get",), ("TypesPlatform", "Version", "Status", "RealStatus", "IntegerStatus", "BooleanStatus")),
        (("Get",), ("StringStatus", "DirectionalDerivative", "RealOutputDerivatives")),
        (("Instantiate", "Terminate", "Reset", "SetupExperiment", "SetDebugLogging", "DoStep", "CancelStep"), ("",)),
        (("Enter", "Exit"), ("InitializationMode",)),
        (("Free",), ("Instance", "FMUstate")),
        (("SerializeFMUstate", "DeSerializeFMUstate", "SerializedFMUstateSize", "SetRealInputDerivatives"), ("",)),
    )
    for name in names
    for kind in kinds
}


OF_THE_RIG = [name for name, effect in LIBRARY.items() if effect.level is Level.INSTRUMENT]


def archive(exported: Exported) -> dict[str, bytes]:
    """What the one file of an export holds."""
    ((_, content),) = exported.files.items()
    with zipfile.ZipFile(io.BytesIO(content)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def test_the_library_exports_the_interface_and_needs_no_other(exported):
    """Names that a stripped library exports and needs are texts in it."""
    content = archive(exported)
    ((path, library),) = [(path, data) for path, data in content.items() if path.startswith("binaries/")]
    assert path.split("/")[1] == {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}[sys.platform]
    assert [name for name in FUNCTIONS if f"{name}\0".encode() not in library] == []
    assert b"\0directions\0" not in library, "only the interface is visible"
    needed = {text.decode() for text in re.findall(rb"[\w./-]+\.(?:so|dll|dylib)\b", library, re.IGNORECASE)}
    assert [name for name in needed if "bushfit" not in name and "libSystem" not in name] == []
    listed = {file.get("name") for file in ET.fromstring(content["modelDescription.xml"]).iter("File")}
    assert listed == {"fmu.c", "bushing.c", "model.c"}
    assert {f"sources/{name}" for name in (*listed, "bushing.h", "fmi2.h", "model.h")} <= set(content)


def test_the_same_model_gives_the_same_bytes_and_another_its_own_guid(paper_model):
    once, again = (export(request_of(paper_model)).files for _ in range(2))
    assert once == again
    stiffer = archive(export(request_of(paper_model.with_values({"mu": 2e6}))))
    own = ET.fromstring(archive(Exported(once))["modelDescription.xml"]).get("guid")
    assert ET.fromstring(stiffer["modelDescription.xml"]).get("guid") != own


def test_names_with_quotes_and_markup_come_through(paper_model, tmp_path):
    assert paper_model.bushing
    bushing = replace(paper_model.bushing, name='"A" & <b>\'\x07é</b> ]]>')
    mount = Specimen('<mount> "&1"', "shear", area=1e-3, thickness=5e-3)
    model = Model(bushing, paper_model.effects, paper_model.values)
    wanted = request_of(model, (Direction.AXIAL, mount), specimens=(mount,))
    file = written(wanted, tmp_path)
    assert file.name == "bushfit_a_b_b.fmu"
    assert validate_fmu(str(file)) == []
    running = Running(file, tmp_path / "named")
    assert running.description.modelName == '"A" & <b>\'_é</b> ]]>'
    assert running.inputs == ["displacement.axial", 'displacement.<mount> "&1"']
    force = running.run(1e-4 * np.linspace(0.0, 1.0, 11)[:, None] * np.ones(2), 1e-3)
    assert np.all(np.diff(force, axis=0) > 0.0)
    coupon = Specimen("DMA", "modulus")
    alone = request_of(Model(None, paper_model.effects, paper_model.values), (coupon,), specimens=(coupon,))
    running = Running(written(alone, tmp_path), tmp_path / "coupon")
    assert (running.inputs, running.outputs) == (["strain.DMA"], ["stress.DMA"])


def test_instances_do_not_see_each_other_and_a_state_is_taken_up_again(paper):
    motion = 2e-4 * wandering(300, 1e-3, seed=3)[:, None] * np.array([1.0, 1.0, 50.0])
    expected = paper.run(motion, 1e-3)
    first, second = (paper.begun(paper.instance()) for _ in range(2))
    half = paper.follow(first, motion[:150], 1e-3)
    np.testing.assert_array_equal(paper.follow(second, motion, 1e-3), expected)
    np.testing.assert_array_equal(half, expected[:150])
    first.reset()
    np.testing.assert_array_equal(paper.follow(paper.begun(first), motion, 1e-3), expected)
    for each in (first, second):
        each.terminate()
        each.freeInstance()
    motion = 2e-4 * wandering(300, 1e-3, seed=4)[:, None] * np.array([1.0, 1.0, 50.0])
    made = paper.begun(paper.instance())
    paper.follow(made, motion[:150], 1e-3)
    state = made.getFMUState()
    kept = made.serializeFMUState(state)
    once = paper.follow(made, motion[149:], 1e-3)
    made.setFMUState(state)
    np.testing.assert_array_equal(paper.follow(made, motion[149:], 1e-3), once)
    other = paper.begun(paper.instance())
    revived = other.deSerializeFMUstate(kept)
    other.setFMUState(revived)
    np.testing.assert_array_equal(paper.follow(other, motion[149:], 1e-3), once)
    made.freeFMUState(state)
    other.freeFMUState(revived)
    made.freeInstance()
    other.freeInstance()


@pytest.mark.parametrize("name", ["kraus", "hysteretic_loss"])
def test_effects_without_a_law_in_time_are_refused(paper_model, name):
    with pytest.raises(ModelError, match="for which this effect has no law") as refused:
        time_model(request_of(paper_model.with_effect(name)))
    assert refused.value.place == name


def test_effects_of_the_rig_are_left_out_and_what_is_held_is_said_with_its_error(paper_model):
    plain, *others = (
        [value.name for value in time_model(request_of(model, (Direction.AXIAL,))).values]
        for model in (paper_model, *(paper_model.with_effect(name) for name in OF_THE_RIG))
    )
    assert dict(zip(OF_THE_RIG, others, strict=True)) == dict.fromkeys(OF_THE_RIG, plain)
    # m (e0/0.01)^-q, held at the geometric middle of 0.1 and 0.5 mm: the whole error is that of the springpot.
    model = paper_model.with_effect("coupled_breakdown", {"coupled_breakdown.q": 0.3})
    found = time_model(request_of(model, (Direction.AXIAL,)))
    (line,) = (line for line in found.omissions if "coupled_breakdown" in line)
    strain = np.array(LEVELS[Direction.AXIAL])[:, None] * model.unit_strain(Direction.AXIAL)
    middle = np.sqrt(strain[0] * strain[-1])
    frequency = np.arange(5.0, 156.0, 10.0)
    whole = model.stiffness("axial", frequency, np.array(LEVELS[Direction.AXIAL])[:, None])
    springpot = 0.5 * 2e5 * (2j * np.pi * frequency) ** 0.24 * model.stiffness_per_modulus(Direction.AXIAL)
    error = np.abs(springpot * ((middle / 0.01) ** -0.3 - (strain / 0.01) ** -0.3) / whole).max()
    assert f"error of the stiffness up to {100.0 * error:.2g} %" in line
    held = next(value for value in found.values if value.name == "m")
    assert held.value == pytest.approx(2e5 * (middle.item() / 0.01) ** -0.3)
    soft = time_model(request_of(paper_model.with_effect("mullins_softening", {"mullins_softening.share": 0.1})))
    assert [line for line in soft.omissions if "mullins_softening: error of the stiffness up to" in line]


def test_without_a_compiler_it_is_said_how_to_get_one(paper_model, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(OutputError, match="no compiler") as refused:
        export(request_of(paper_model))
    assert refused.value.hint == 'pip install "bushfit[fmu]"'
