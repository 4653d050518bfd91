"""Classes that are called like a Windows device export to files that Windows can hold."""

import zipfile

import fmpy
import pytest

from cosim.cli.main import main
from fmu.archives.checks import is_device, no_device
from fmu.describe.description import model_identifier


@pytest.mark.parametrize("name", ["Aux", "Nul", "CON", "com1", "LPT9", "prn"])
def test_no_identifier_is_a_device(name):
    assert model_identifier(name) == f"_{name}"
    assert not is_device(model_identifier(name))


@pytest.mark.parametrize("name", ["Auxiliary", "com", "com10", "Console", "_aux", "x.aux"])
def test_other_names_stay(name):
    assert no_device(name) == name


def test_an_ending_makes_no_file_of_a_device():
    assert no_device("aux.v2") == "_aux.v2"


def test_the_fmu_of_such_a_class_is_sound(tmp_path, capsys):
    (tmp_path / "plant.py").write_text("from hybrid_model.models import BouncingBall\nclass Aux(BouncingBall): pass\n")
    assert main(["export", f"{tmp_path / 'plant.py'}:Aux", "--out", str(tmp_path)]) == 0
    file = tmp_path / "_Aux.fmu"
    assert capsys.readouterr().out.strip() == str(file)
    assert main(["validate", str(file), "--no-run", "--strict"]) == 0
    assert fmpy.read_model_description(str(file)).modelName == "Aux"
    with zipfile.ZipFile(file) as archive:
        assert not [name for name in archive.namelist() if any(map(is_device, name.split("/")))]
    # Free fall from 1 m: h = 1 - g t^2 / 2; 1e-9 covers the tolerances of the FMU.
    result = fmpy.simulate_fmu(str(file), stop_time=0.4)
    assert result["h"][-1] == pytest.approx(1.0 - 9.81 * 0.08, abs=1e-9)
    capsys.readouterr()
