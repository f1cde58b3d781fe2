"""Text logs: preamble, comments, units, encodings, decimal commas, compression; and what is wrong in one."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import refused, write_csv
from places import CASES

from hybridsep.logs.log import read_log

TWO_ROWS = "0,1,2\n1,3,4\n"


@pytest.mark.parametrize(
    "text",
    [
        # Delimiters, quotes, blanks, line ends
        "t, x_d, x\r\n0, 1, 2\r\n1, 3, 4\r\n",
        "t;x_d;x\n0;1;2\n1;3;4",
        "t\tx_d\tx\n0\t1\t2\n1\t3\t4\n",
        "t x_d   x\n0 1 2\n 1  3 4\n",
        '"t","x_d","x"\n"0","1","2"\n1,3,4\n',
        "'t','x_d','x'\n'0','1','2'\n'1','3','4'\n",
        "\n\nt,x_d,x\n\n0,1,2\n\n1,3,4\n\n",
        "note,x,t,x_d\n9,2,0,1\nno number,4,1,3\n",
        "t,x_d,x,\n0,1,2,\n1,3,4,\n",
        "| t | x_d | x |\n|---|---|---|\n| 0 | 1 | 2 |\n| 1 | 3 | 4 |\n",
        # Preambles, comments and rows of units
        "Machine;A 12\nDate;2023-12-21\n\nt;x_d;x\n0;1;2\n1;3;4\n",
        "# machine A\n% two marks\n// three\nt,x_d,x\n0,1,2\n# paused, here\n1,3,4\n",
        "# t,x_d,x\n# recorded yesterday\n" + TWO_ROWS,
        "t;x_d;x\n[s];[m];[-]\n0;1;2\n1;3;4\n",
        "3 4 5\nt x_d x\n0 1 2\n1 3 4\n",
        "".join(f"key {i}: value\n" for i in range(300)) + "t,x_d,x\n" + TWO_ROWS,
        "".join(f"key {i},{i}\n" for i in range(400)) + "t,x_d,x\n" + TWO_ROWS,
        "t,x_d,x\nfloat,float,float\n" + TWO_ROWS,
        "t,x_d,x\nTime of day,Wanted,Real\nms,mm,mm\n0,1000,2000\n1000,3000,4000\n",
        "recorded,by,nobody\nInterval,1 ms,\nDuration,2 s,\nRate,9 Hz,\nt,x_d,x\n" + TWO_ROWS,
        ",X axis,\ntime,command,actual\n" + TWO_ROWS,
        # Decimal commas, with every delimiter that leaves them readable
        "t;x_d;x\n0;1,0;2\n1;3;4,0\n",
        "t\tx_d\tx\n0,0\t1,0\t2,0\n1,0\t3,0\t4,0\n",
        "t x_d x\n0,0 1,0 2,0\n1,0 3,0 4,0\n",
        't,x_d,x\n0,"1,0","2,0"\n1,"3,0","4,0"\n',
        # Names beside which the units stand
        "t [s],x_d [m],x [m]\n" + TWO_ROWS,
        "t (ms);x_d (mm);x (µm)\n0;1000;2e6\n1000;3000;4e6\n",
        "time_ms,x_d_mm,x_meas_mm\n0,1000,2000\n1000,3000,4000\n",
        "t / us\tx_d in mm\tx / m\n0\t1000\t2\n1e6\t3000\t4\n",
        "t;x_d;x\nms;mm;um\n0;1000;2e6\n1000;3000;4e6\n",
        # Names that a controller has
        "Time [s],Position Commanded [mm],Position Actual [mm]\n0,1000,2000\n1,3000,4000\n",
        "Timestamp,POS_CMD,POS_ACT\n" + TWO_ROWS,
        "t,x_d,x,x_m\n0,1,2,9\n1,3,4,9\n",
        "Elapsed Time (ms),cycle_time,x_d,x\n0,7,1,2\n1000,7,3,4\n",
        "millis,target_position,current_position\n0,1,2\n1000,3,4\n",
        "Zeit [ms];Solllage [mm];Istlage [mm]\n0;1000,0;2000\n1000;3000;4000\n",
        "time_ms,pos_sp_meter,pos_pv_meter\n0,1,2\n1000,3,4\n",
        "epoch_ms,q_des_inch,q_meter\n0,39.37007874015748,2\n1000,118.11023622047244,4\n",
        "t;x_d;x\nms;mm;um\nSR1;CH1;CH2\n0;1000;2e6\n1000;3000;4e6\n",
        # Units in cells, as MATLAB writes durations; rows with a key
        "Time;x_d;x\n0 ms;1000 mm;2.0 m\n1000 ms;3000 mm;4.0 m\n",
        "trace_path,time,Root/x_ref,Root/x_meas\ntrace_unit,s,mm,-\nvalues,0,1000,2\nvalues,1,3000,4\n",
        "Name;Zeit;Soll;Ist;U\nEinheit;ms;mm;mm;V\n;0;1000;2000;5\n;1000;3000;4000;5\n",
        # Units of other quantities beside them, above the names, or after a blank
        "Time;x_d;x;I;M;v;on\nms;mm;mm;A;%;rpm;BOOL\n0;1000;2000;5;5;5;1\n1000;3000;4000;5;5;5;1\n",
        "s,mm,mm,°C\nt,cmd,act,T\n0,1000,2000,5\n1,3000,4000,5\n",
        "run,5,a,b,c\nt,x_d,x,step,count\n0,1,2,5,5\n1,3,4,5,5\n",
        "Unit,mm,mm\nTime[ms],PCMD(X),POSF(X)\n0,1000,2000\n1000,3000,4000\n",
        ";5 mm;5 mm\nt;x_d;x\n0;1;2\n1;3;4\n",
        "Time ms;Pos cmd mm;Pos [mm] act\n0;1000;2000\n1000;3000;4000\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "latin-1", "utf-16", "utf-16-le", "utf-16-be"])
def test_layouts(tmp_path: Path, text: str, encoding: str) -> None:
    log = read_log(write_csv(tmp_path / "log", text, encoding))
    np.testing.assert_allclose([log.t, log.x_d, log.x_meas], [[0, 1], [1, 3], [2, 4]], rtol=1e-15)
    assert (log.T_s, log.unit) == (1.0, "m")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,x_d [mm/s],x\n0,1,2\n", r"column 'x_d \[mm/s\]' must be a position in one of m, .* its unit is 'mm/s'"),
        ("t,x_d,x,I\ns,inc,inc,A\n0,1,2,3\n1,3,4,3\n", "column 'x_d' is in encoder counts; give the length"),
        ("t;x_d;x\ns;Grad;Grad\n0;1;2\n1;3;4\n", "must be a position in one of m, .*, its unit is 'Grad'"),
        ("t;x_d;x\n0;1'047,9;2\n1;3;4,5\n", "'x_d' must be a number, got \"1'047,9\"; write numbers without"),
        ("t,x_d [counts],x\n0,1,2\n", r"'x_d \[counts\]' is in encoder counts; give the length of one.*--unit 0\.1um"),
        ("t,x_d [m],x [deg]\n0,1,2\n", r"'x_d \[m\]' is in m and column 'x \[deg\]' in deg; both must be lengths or"),
        ("t [h],x_d,x\n0,1,2\n", r"time 't \[h\]' must be in one of s, ms, us, ns, min, its unit is 'h'; correct"),
        ("t,x [mm],x_d,x_mm\n0,1,2,3\n", r"column x may be 'x \[mm\]', 'x_mm'; name it: --x NAME"),
        ("t;x_d;x\n0;1;2\n1;1.000,5;2\n", r"line 3: column 'x_d' must be .* got '1\.000,5'; write numbers without"),
        ("t,x_d,x\n0,1,2\n00:01.5,1,2\n", r"line 3: column 't' must be a number, got '00:01\.5'; write times of"),
        ("a\nb;c\n# d\n1;2\n", r"columns 't', 'x_d', 'x' are missing, the file has 'b', 'c'"),
        (TWO_ROWS, r"has no line of names, its first line is numbers \('0', '1', '2'\); put one above.* as t,x_d,x: "),
        ("t,x_d,x\n0,0,0\n1,nan,0\n", r"log\.csv, line 3: column 'x_d' must be finite, got nan$"),
        ("t,x_d,x\n0,0,0\n1,0,inf\n", "line 3: column 'x' must be finite, got inf$"),
        ("t,x_d,x\n0,0,0\n1,abc,0\n", "line 3: column 'x_d' must be a number, got 'abc'$"),
        ("t,x_d,x\n0,,0\n1,0,0\n", "line 2: column 'x_d' must be a number, got nothing$"),
        ("t,x_d,x\n0,0,0\n1,1_0,0\n", "line 3: column 'x_d' must be a number, got '1_0'"),
        (
            "t,x_d,x\n0,0,0\n\n1,0\n",
            "line 4: 3 columns were expected as in line 1, got 2; correct the line, or take it out",
        ),
        ("t,x_d,x\n0,0,0\n1,0,0,0\n", "line 3: 3 columns were expected as in line 1, got 4"),
        (f't,x_d,x\n0,0,"{"a" * 200_000}"\n', "line 2: column 'x' must be a number, got 'aaa"),
        (
            "t,pos_act,pos_err\n0,1,2\n",
            r"name it: --x_d .*; or the error beside .*: --error=pos_err \(where .* --error=-pos_err\), in Python col",
        ),
        ("t,x_d,x\nms,mm,mm\nx1,x0.5,x0.5\n0,1,2\n1,3,4\n", "the file has 'x1', 'x0.5'"),
        ("t,x_d,x\n0 s,1,2\n1 min,3,4\n", "line 2: column 't' must be a number, got '0 s'$"),
        ("t,pos_err\n0,1\n", "an error alone tells neither position"),
        ("t,vel_cmd,vel_act\n0,1,2\n", r"columns 'x_d', 'x' are missing, .*; velocities are none: record positions$"),
        (
            "t,axis,x_d,x\n" + "".join(f"{k // 2},{'XY'[k % 2]},{k % 2},{k % 2}\n" for k in range(9)),
            "rows of 2 axes follow",
        ),
        ("t,x_d,x\n" + "0,0,\n.5,,0\n" * 9, r"rows have either 'x_d' or 'x': channels with times of their own;"),
        ("t,x_d,x\n0;0;0\n", "line 2: column 't' must be a number, got '0;0;0'"),
        (",t,target,theta\n0,0,1,2\n1,1,2,3\n", "columns 'x_d', 'x' are missing"),  # row labels are no bare axis
    ],
)
def test_refused_texts(tmp_path: Path, text: str, message: str) -> None:
    refused(message, write_csv(tmp_path / "log.csv", text))


def test_a_log_of_labview(tmp_path: Path) -> None:
    head = "LabVIEW Measurement\t\nReader_Version\t2\n***End_of_Header***\t\nChannels\t2\t\t\t\nSamples\t9\t9\t\t\n"
    head += "Y_Unit_Label\tmm\tmm\t\nX0\t0.0\t0.0\t\nDelta_X\t0.5\t0.5\t\n***End_of_Header***\t\t\t\n"
    rows = "".join(f"{k / 2:.3f}\t{k}.0\t{k}.5\n" for k in range(9))
    log = read_log(write_csv(tmp_path / "log.lvm", f"{head}X_Value\tCommand\tActual\tComment\n{rows}"))
    assert (log.T_s, log.file_unit, log.columns["x"], log.x_meas[1]) == (0.5, "mm", "Actual", 1.5e-3)


def test_latin_1_far_down(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = b"".join(b"%g,0,0,\n" % (0.1 * i) for i in range(20_000))
    path.write_bytes(b"t,x_d,x,note\n" + rows + b"2000,0,0,\xe9t\xe9")
    assert len(read_log(path).t) == 20_001


# What recorders write beside their numbers


ROWS = [f"{k / 1000:.3f},{k % 7},{k % 7}.5" for k in range(50)]


@pytest.mark.skipif(not CASES.is_dir(), reason="needs ../shared/cases/logs beside the repository")
def test_a_trace_of_changes() -> None:
    """A setpoint that is written when it changes, and an encoder that is sampled half as often."""
    log = read_log(CASES / "sinumerik_axis7_blank_cells.csv")
    assert (len(log.t), log.T_s, log.unit, int(np.isnan(log.x_meas).sum())) == (3000, 2e-3, "rad", 1500)
    assert not log.x_d.any()
    assert log.remarks[-1] == ("column 'Position setpoint [deg]' is blank in 2999 rows: read as before, as in a trace")


@pytest.mark.parametrize("name", ["rownames_R", "trail_header_only", "trail_rows_only", "trail_semicolon_rows"])
@pytest.mark.skipif(not CASES.is_dir(), reason="needs ../shared/cases/logs beside the repository")
def test_recorded_texts(name: str) -> None:
    log = read_log(CASES / f"{name}.csv")
    assert (len(log.t), log.T_s, log.file_unit) == (59 if "names" in name else 50, 1e-3, "mm")
    assert np.isfinite(log.x_meas).all()


@pytest.mark.parametrize(
    "missing", ["NA", "N/A", "#N/A", "NULL", "null", "nan", "-nan(ind)", "1.#QNAN", "-1.#IND00", "<NA>", "---", ""]
)
def test_spellings_of_a_missing_measurement(tmp_path: Path, missing: str) -> None:
    rows = [f"{row.rpartition(',')[0]},{missing}" for row in ROWS[:10]] + ROWS[10:]
    log = read_log(write_csv(tmp_path / "log.csv", "\n".join(["t,x_d,x", *rows])))
    assert np.flatnonzero(np.isnan(log.x_meas)).tolist() == [*range(10)]
    assert np.isfinite(log.x_d).all()


def test_a_blank_command_is_as_before(tmp_path: Path) -> None:
    log = read_log(write_csv(tmp_path / "log.csv", "t,x_d,x\n0,1,2\n1,,2\n2,,3\n3,4,4\n"))
    assert log.x_d.tolist() == [1.0, 1.0, 1.0, 4.0]


def test_lines_without_numbers_are_said(tmp_path: Path) -> None:
    rows = [ROWS[0], "t,x_d,x", *ROWS[1:20], "overrun", *ROWS[20:], "end of recording"]
    log = read_log(write_csv(tmp_path / "log.csv", "\n".join(["t,x_d,x", *rows])))
    assert len(log.t) == 50
    assert log.remarks == ("3 lines without numbers among the rows left out, line 3 first: 't,x_d,x'",)


@pytest.mark.parametrize(
    ("names", "axes"),
    [
        ("X1_CommandPosition,X1_ActualPosition,Y1_CommandPosition,Y1_ActualPosition", ["X1", "Y1"]),
        ("joint_pos_target_1,joint_pos_1,joint_pos_target_2,joint_pos_2", ["1", "joint_2"]),
        ("XPosRef,XPosFb,YPosRef,YPosFb", ["x", "y"]),
        ("X_cmd [mm],X_act [mm],Y_cmd [mm],Y_act [mm]", ["X", "Y"]),
        ("XPOS_CMD,XPOS_FB,YPOS_CMD,YPOS_FB", ["X", "Y"]),
    ],
)
def test_axes_of_a_text(tmp_path: Path, names: str, axes: list[str]) -> None:
    rows = "".join(f"{k % 5},{k % 5}.25,{k % 3},{k % 3}.5\n" for k in range(9))
    path = write_csv(tmp_path / "log.csv", f"{names}\n{rows}")
    for axis, (x_d, x) in zip([None, *axes], [(1.0, 1.25), (1.0, 1.25), (1.0, 1.5)], strict=True):
        log = read_log(path, T_s=1e-3, axis=axis, unit="mm")
        assert (1e3 * log.x_d[1], 1e3 * log.x_meas[1]) == pytest.approx((x_d, x))
    refused("axis 'Q' is missing; there are ", path, T_s=1e-3, axis="Q")


@pytest.mark.parametrize(
    ("rows", "right"),
    [
        ("0.000;120,000;119,999\n0.001;120,001;120,000\n", [120.0, 120.001]),
        ("0.000;0;1\n0.001;1,200;1,201\n", [0.0, 1.2]),
        ("0;999;998\n1;1,000;1,000\n", [0.999, 1.0]),
        ("0;999;998\n1;1.000;1.000\n2;1.001;1.002\n", r"line 3: .* must be a number, got '1.000'; .* or it divides"),
        ("0;0;0\n1;1.000;1.000\n2;1.001;1.002\n", [0.0, 1e-3, 1.001e-3]),
        ("0;1.5;900\n1;2.5;1.000\n", [1.5e-3, 2.5e-3]),  # other numbers have decimal points
        ("0;120,000;1,000\n1;120,001;1,001\n", [0.12, 0.120001]),
        ("0.000;1,000,000.5;1,000,000\n0.001;1,000,001.5;1,000,000\n", [1000.0005, 1000.0015]),
        ("0,000;120,000;119,999\n0,001;120,001;120,000\n", [0.12, 0.120001]),
        ("0.000;1;1\n0.001;1,20;1,201\n", r"line 3: column 'x_d \[um\]' must be a number, got '1,20'; .* of thousands"),
        ("".join(f"{k / 1000:.3f};{k:,};{k:,}\n" for k in range(1010)), np.arange(1010.0) / 1e3),
        ("".join(f"{k};{max(0, k - 500):,};{k:,}\n" for k in range(1600)), np.r_[np.zeros(500), :1100] / 1e3),
        ("".join(f"{k};{k / 8:g};1\n".replace(".", ",") for k in range(1010)) + "1010;1.234;1\n", r"12: .*'1.234'; o"),
    ],
)
def test_points_and_commas(tmp_path: Path, rows: str, right: Any) -> None:
    """A file with both has thousands, or is refused, wherever they begin."""
    path = write_csv(tmp_path / "log.csv", f"t [s];x_d [um];x [um]\n{rows}")
    if isinstance(right, str):
        refused(right, path)
    else:
        np.testing.assert_allclose(read_log(path).x_d, 1e-3 * np.array(right), rtol=1e-12)
    versions = [f"{k};{100 + k % 9},250;1;{1.5 if k == 1200 else 1}\n" for k in range(1500)]
    pointed = read_log(write_csv(tmp_path / "pointed.csv", "".join(["t [ms];x_d [um];x [um];version\n", *versions])))
    assert pointed.x_d[:2] == pytest.approx([1.0025e-4, 1.0125e-4])
    quoted = write_csv(tmp_path / "quoted.csv", 't [s],x_d [um],x [um]\n0.000,"120,000",5\n0.001,"120,001",5\n')
    np.testing.assert_allclose(read_log(quoted).x_d, [0.12, 0.120001], rtol=1e-12)
