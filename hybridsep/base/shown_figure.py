"""Matplotlib figure that a notebook shows without pyplot or a magic command."""

import io

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """Figure with IPython's representation as PNG."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()
