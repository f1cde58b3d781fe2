"""Section 3.1 of the paper in numbers: which unmodelled forces past residuals give away, and where news comes in.

Run it with ``python examples/section_3_1.py``.
"""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from hybridsep.mechanism import demonstrate


def main() -> None:
    """Print one row for each kind of disturbance."""
    title = "What past residuals leave open: 10 mm, 2 Hz, Ts = 1 ms; RMS and largest in µm"
    table = Table(title=title, box=box.SIMPLE, padding=0)
    for heading in ("disturbance", "order", "e_pb", "off (10)", "news", "largest", "spikes"):
        table.add_column(heading, justify="left" if heading == "disturbance" else "right", no_wrap=True)
    for case in demonstrate():
        table.add_row(
            case.name,
            str(case.order),
            f"{1e6 * case.residual_rms:.2f}",
            f"{1e6 * case.closed_form_error:.0e}",
            f"{1e6 * case.innovation_rms:.1e}",
            f"{1e6 * case.innovation_max:.1e}",
            str(case.n_spikes),
        )
    Console().print(table)


if __name__ == "__main__":
    main()
