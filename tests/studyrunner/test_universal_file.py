"""Frequency responses that were measured, from files that pyuff writes."""

import numpy as np
import pytest
import pyuff

from studyrunner import read_study
from studyrunner.user_error import UserError

FREQUENCY = np.linspace(0.0, 300.0, 301)
RECEPTANCE = 1.0 / (1e6 - (2.0 * np.pi * FREQUENCY) ** 2 + 2e4j)  # m/N
SI = {"units_code": 1, "units_description": "SI", "temp_mode": 1, "temp": 1.0, "temp_offset": 0.0}
OF = {8: ("m", 0), 11: ("m/s", 1), 12: ("m/s^2", 2)}  # label, and how often derived


def write(path, *records):
    """A file with a frequency response for each record: keys of pyuff in place of those of an acceleration in SI."""
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    for record in records:
        if record.get("type") == 164:
            file.write_sets({**SI, **record}, "add")
            continue
        kind = record.get("ordinate_spec_data_type", 12)
        label, times = OF[kind]
        given = {"binary": 0, "func_type": 4, "rsp_node": 14, "rsp_dir": 3, "ref_node": 2, "ref_dir": -3}
        given |= {"ordinate_spec_data_type": kind, "orddenom_spec_data_type": 13, "abscissa_spec_data_type": 18}
        given |= {"ordinate_axis_units_lab": label, "orddenom_axis_units_lab": "N", "x": FREQUENCY}
        given["data"] = RECEPTANCE * (2j * np.pi * FREQUENCY) ** times
        file.write_sets(pyuff.prepare_58(**(given | record)), "add")


def measured(path, **given):
    table = {"file": str(path), "standard_deviation": 1e-6, "force": 20.0, "between": [100.0, 250.0], **given}
    return read_study("sdof_slider", {"measured.response_amplitude": table}).measured.response_amplitude[0]


# pyuff leaves the binary files open that it writes
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("kind", OF)
@pytest.mark.parametrize("binary", [0, 1])
def test_amplitudes_under_a_force(kind, binary, tmp_path):
    write(tmp_path / "frf.uff", {"ordinate_spec_data_type": kind, "binary": binary})
    found = measured(tmp_path / "frf.uff")
    kept = (FREQUENCY >= 100.0) & (FREQUENCY <= 250.0)
    assert found.over == "frequency"
    np.testing.assert_allclose(found.at, FREQUENCY[kept])
    np.testing.assert_allclose(found.value, 20.0 * np.abs(RECEPTANCE[kept]), rtol=1e-9)


def test_units_by_the_label_or_by_those_of_the_file(tmp_path):
    """In g over kN; in mm/s2 over mN, as the file says where an axis has no label."""
    metres = RECEPTANCE * (2j * np.pi * FREQUENCY) ** 2
    in_g = {"ordinate_axis_units_lab": "g", "orddenom_axis_units_lab": "kN", "data": 1e3 * metres / 9.80665}
    write(tmp_path / "g.unv", {"type": 164, "length": 1e3, "force": 1e3}, in_g)
    no_labels = {"ordinate_axis_units_lab": "NONE", "orddenom_axis_units_lab": "NONE", "data": 1e3 * metres / 1e3}
    write(tmp_path / "mm.unv", {"type": 164, "length": 1e3, "force": 1e3}, no_labels)
    write(tmp_path / "si.unv", {})
    expected = measured(tmp_path / "si.unv").value
    for name in ("g", "mm"):
        np.testing.assert_allclose(measured(tmp_path / f"{name}.unv").value, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("records", "given", "words"),
    [
        ([{}, {"rsp_node": 7}], {}, r"record.*give the number of one of its functions: 1 14:\+3 by 2:-3, 2 7:\+3"),
        ([{}], {"record": 2}, "record = 2"),
        ([{"func_type": 2}], {}, "record 1 has function type 2, complex.*give a complex frequency response"),
        ([{"data": abs(RECEPTANCE)}], {}, "function type 4, real"),
        ([{"orddenom_spec_data_type": 12}], {}, r"data 12 over 12.*over a force \(13\)"),
        ([{"ordinate_axis_units_lab": "furlong"}], {}, 'unit "furlong" of the ordinate is not known'),
        ([{"ordinate_axis_units_lab": "NONE"}], {}, "or leave the label empty and write a dataset 164"),
        ([{}], {"force": None}, "give force, N"),
        ([{}], {"between": [400.0, 500.0]}, "give a range in its 0 to 300 Hz"),
        ([{}], {"between": "all"}, "give two frequencies, Hz"),
        ([{"type": 164, "length": 1.0, "force": 1.0}], {}, "give a file with dataset 58"),
        ([], {}, "is not there"),
    ],
)
def test_a_wrong_file_gets_one_line(records, given, words, tmp_path):
    write(tmp_path / "frf.uff", *records)
    with pytest.raises(UserError, match=words) as error:
        measured(tmp_path / "frf.uff", **given)
    assert "\n" not in str(error.value)


def test_what_is_no_universal_file_or_no_response(tmp_path):
    (tmp_path / "frf.uff").write_bytes(b"    -1\n    58\nnothing\n    -1\n")
    with pytest.raises(UserError, match="give a file of universal format"):
        measured(tmp_path / "frf.uff")
    given = {"file": str(tmp_path / "frf.uff"), "standard_deviation": 1e-12}
    with pytest.raises(UserError, match="universal files hold responses alone"):
        read_study("sdof_slider", {"measured.worn_volume": given})
