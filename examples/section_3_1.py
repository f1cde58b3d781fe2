"""Section 3.1 of the paper in numbers: unmodelled inputs that past residuals determine, and the innovation left.

Run it with ``python examples/section_3_1.py``.
"""

from __future__ import annotations

import numpy as np
from mechanism import Drive, decay
from mechanism_cases import demonstrate
from rich import box
from rich.console import Console
from rich.table import Table


def main() -> None:
    """Print one row for each kind of ``h`` in eq. (7), and how long the drive remembers one sample of it."""
    title = "What past residuals leave open, RMS and largest in µm"
    table = Table(title=title, box=box.SIMPLE, padding=0)
    for heading in ("h in eq. (7)", "order", "e_pb", "off (10)", "news", "largest", "spikes"):
        table.add_column(heading, justify="left" if heading == "h in eq. (7)" else "right", no_wrap=True)
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
    console = Console(highlight=False)
    console.print(table)
    drive = Drive.spring_mass_damper()
    left = decay(drive.A, drive.Gamma, drive.C, 3000)
    console.print(
        f"C Aⁿ Γ ≈ 0 for n ≥ p, as the paper assumes? From n = 50 on, its p, {left[50]:.0%} is left, "
        f"1 % from n = {np.argmax(left < 0.01)}, 0.1 % from n = {np.argmax(left < 0.001)}."
    )


if __name__ == "__main__":
    main()
