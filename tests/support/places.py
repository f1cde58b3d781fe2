"""Paths of this checkout and of the recordings beside it."""

from pathlib import Path

SUPPORT = Path(__file__).resolve().parent
ROOT = SUPPORT.parents[1]
EMPS = ROOT.parent / "shared" / "data" / "emps" / "DATA_EMPS.mat"
RECORDINGS = ROOT.parent / "shared" / "data" / "recordings"
SO101 = ROOT.parent / "shared" / "data" / "so101"
CASES = ROOT.parent / "shared" / "cases" / "logs"
SINUMERIK = CASES.parent / "sinumerik" / "kit_dmc60h_1000rows.csv"
LOOPS = CASES.parent / "loops"
