"""Paths of this checkout, of its recordings and of what may be beside it."""

from pathlib import Path

SUPPORT = Path(__file__).resolve().parent
ROOT = SUPPORT.parents[1]
EMPS = ROOT.parent / "shared" / "data" / "emps" / "DATA_EMPS.mat"
RECORDINGS = ROOT / "benchmarks" / "recordings"
CAPTURE = ROOT.parent / "shared" / "data" / "recordings" / "cnc_a_capture.json"
CASES = ROOT.parent / "shared" / "cases" / "logs"
SINUMERIK = CASES.parent / "sinumerik" / "kit_dmc60h_1000rows.csv"
LOOPS = CASES.parent / "loops"
