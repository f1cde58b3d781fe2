"""Ablation of the model with averaging: each of its rules switched off, or its constant changed, one at a time.

    python -m benchmarks.ablation [--emps DATA_EMPS.mat] [--n 12] [--only TEXT] [--lines] [--jobs 2]

Axes of ``benchmarks/ablation/axes.py``, replayed by the C core with some of its lines changed. The first row has the
errors relative to what an axis is judged by, geometric means of cold and warm runs and the worst lines; the others have
what a change makes of them, by factors. A rule stays if without it a test group is worse by 2 %, or a line by a
third. A second table has the intervals: their score at 90 % relative to the first row, and the coverage of 50, 90 and
95 %.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.ablation.axes import Axis, Errors, errors_of, logs_of, simulations_of
from benchmarks.ablation.core import Changes, CoreVariant
from hybridsep.base.errors import SignalError
from hybridsep.predict.averaging.constants import CONSTANTS

AVERAGING = "predict/averaging/"
START = AVERAGING + "hsep_start.h"
STATE, FORECAST = (AVERAGING + f"hsep_averaged_{part}.c" for part in ("model", "forecast"))


def constants(**values: float) -> Changes:
    """Return the change of constants, by their names in the dataclass."""
    return {
        "predict/hsep_predict_constants.h": [
            (
                f"HSEP_AVERAGING_{name.upper()} {getattr(CONSTANTS, name)!r}\n",
                f"HSEP_AVERAGING_{name.upper()} {value!r}\n",
            )
            for name, value in values.items()
        ]
    }


def first_weights(residual: float, static: float) -> Changes:
    """Return the change of the first weights of arx_residual and static."""
    old = "{0.5, 0, 1, 0}, {0.5, 0, 0, 0}"
    return {"predict/hsep_predict_constants.h": [(old, f"{{{residual}, 0, 1, 0}}, {{{static}, 0, 0, 0}}")]}


def together(*changes: Changes) -> Changes:
    """Return several changes as one."""
    found: dict[str, list[tuple[str, str]]] = {}
    for change in changes:
        for path, pairs in change.items():
            found.setdefault(path, []).extend(pairs)
    return found


def without_component(i: int) -> Changes:
    """Return intervals without one of their components."""
    last = "        f[2] = variance != NULL && k >= n_physics ? variance[j] : 0.0;"
    return {"predict/hsep_uncertainty.h": [(last, f"{last}\n        f[{i}] = 0.0;")]}


NO_DOUBTING: Changes = {
    FORECAST: [
        (
            "known[hsep_averaged_kind_of(self, i)] &&",
            "known[hsep_averaged_kind_of(self, i)] && i != HSEP_FRESH_START &&",
        )
    ],
    STATE: [("            hsep_stack_copy(&learned->stacks[i], self->leading, HSEP_FRESH_START);\n", "")],
    **constants(discard_above=2.0),
}

NO_STATIC = together(
    first_weights(1.0, 0.0),
    {
        FORECAST: [
            (
                "known[hsep_averaged_kind_of(self, i)] &&",
                "known[hsep_averaged_kind_of(self, i)] && i != HSEP_STATIC &&",
            ),
            ("    if (self->predicted[HSEP_STATIC]) {", "    if (self->predicted[HSEP_ARX_RESIDUAL]) {"),
            ("hsep_averaged_expert(self, HSEP_STATIC);", "hsep_averaged_expert(self, HSEP_ARX_RESIDUAL);"),
        ]
    },
)

VARIANTS: Mapping[str, Changes] = {
    "no static expert S": NO_STATIC,
    "no doubting expert D": NO_DOUBTING,
    "no D, earlier runs count for 3 windows": together(NO_DOUBTING, constants(warm_windows_max=3.0)),
    "earlier runs never forgotten": constants(discard_above=2.0),
    "earlier runs forgotten whatever they err by": constants(discard_error=0.0, discard_harm=0.0),
    "A's bound does not grow": {FORECAST: [("growth = before > 0.0 ?", "growth = before < 0.0 ?")]},
    "hold goes on where the command turns": {
        FORECAST: [("turned = hsep_disturbances_turned(disturbances, row);", "turned = ((void)row, 0.0);")]
    },
    "features never begin anew": constants(velocity_jump=1e300),
    "rows are independent": constants(correlation_max=1.0),
    "no recall": {AVERAGING + "hsep_recall.h": [("    if (self->size < n +", "    if (self->size < self->size + n +")]},
    "no first differences of disturbances": constants(difference_share=1e-6),
    "first differences as large": constants(difference_share=1.0),
    "last lag as the first": constants(last_lag=1.0),
    "noise at first the least one": constants(first_noise=1e-6),
    "least noise the first one": constants(least_noise=0.01),
    "predictions hardly bounded": constants(bound=100.0),
    "no shrinking": {
        AVERAGING + "hsep_experts.c": [
            (
                "shrinkage[j] = self->largest_square / (self->largest_square + variance);",
                "(void)variance;\n        shrinkage[j] = 1.0;",
            )
        ]
    },
    "stiffness acts at x_pb": {
        FORECAST: [("x[j] = x_pb[j] + hsep_at(at_first, at_first->e_h)[j];", "x[j] = x_pb[j];")]
    },
    "A: 20 lags": constants(lags_of_command=20),
    "runs begin at rest": {START: [("known < HSEP_START_SAMPLES", "known >= 0 * HSEP_START_SAMPLES")]},
    "L from the first": first_weights(1.0, 0.0),
    "S from the first": first_weights(0.0, 1.0),
    "kappa 0.3": constants(kappa=0.3),
    "kappa 3": constants(kappa=3.0),
    "gamma 0.9": constants(gamma=0.9),
    "gamma 0.98": constants(gamma=0.98),
    **{
        f"interval: no {name}": without_component(i)
        for i, name in enumerate(("noise", "timing", "variance of the experts"))
    },
}
"""What is tried, by name."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    parser.add_argument("--n", type=int, default=12, help="random drives of each generator")
    parser.add_argument("--only", default="", help="rows whose name has this text")
    parser.add_argument("--lines", action="store_true", help="a line for each axis, too")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    given = parser.parse_args(arguments)
    tried = {"as it is": {}, **{name: change for name, change in VARIANTS.items() if given.only in name}}
    with ProcessPoolExecutor(given.jobs) as pool:
        logs = [pool.submit(make) for make in logs_of(given.emps)]
        axes = [*(log.result() for log in logs), *simulations_of(given.n)]
        results = pool.map(partial(all_errors, axes), [CoreVariant(change) for change in tried.values()])
    print("\n".join(tables(axes, dict(zip(tried, results, strict=True)), lines=given.lines)))


def all_errors(axes: Sequence[Axis], core: CoreVariant) -> list[Errors]:
    """Return the errors on all axes; infinite where a prediction diverges."""
    found = []
    for axis in axes:
        try:
            found.append(errors_of(axis, core.replay))
        except SignalError:
            found.append(Errors(np.inf, np.inf, np.inf, (0.0, 0.0, 0.0)))
    return found


def tables(axes: Sequence[Axis], results: Mapping[str, Sequence[Errors]], *, lines: bool = False) -> Iterator[str]:
    """Yield the lines of the tables, in Markdown."""
    groups = list(dict.fromkeys(axis.group for axis in axes))
    base = next(iter(results.values()))
    rule = "|---|" + "---|" * len(groups)
    yield f"| cold / warm (worst) | {' | '.join(groups)} |\n{rule}"
    for name, errors in results.items():
        factors = np.array([one[:2] for one in errors])
        if errors is not base:
            factors /= np.array([one[:2] for one in base])
        yield _row(name, [_errors(factors[_of(axes, group)]) for group in groups])
        for axis, (cold, warm) in zip(axes, factors, strict=True) if lines else ():
            yield f"  {axis.name:44} {cold:.3f} {warm:.3f}"
    yield f"\n| score (coverage of 50, 90, 95 %) | {' | '.join(groups)} |\n{rule}"
    for name, errors in results.items():
        scores = np.array([one.score for one in errors]) / np.array([one.score for one in base])
        within = np.array([one.within for one in errors])
        yield _row(name, [_intervals(scores[_of(axes, group)], within[_of(axes, group)]) for group in groups])


def _of(axes: Sequence[Axis], group: str) -> list[int]:
    return [i for i, axis in enumerate(axes) if axis.group == group]


def _row(name: str, cells: Sequence[str]) -> str:
    return f"| {name} | {' | '.join(cells)} |"


def _errors(of_group: np.ndarray) -> str:
    """Return the geometric means of errors, cold and warm, ``(n, 2)``, and the worst ones."""
    (cold, warm), worst = np.exp(np.mean(np.log(of_group), axis=0)), of_group.max(axis=0)
    return f"{cold:.3f} / {warm:.3f} ({worst[0]:.2f} / {worst[1]:.2f})"


def _intervals(scores: np.ndarray, within: np.ndarray) -> str:
    """Return the geometric mean of scores, ``(n,)``, and the mean coverage, ``(n, 3)``, %."""
    return f"{np.exp(np.mean(np.log(scores))):.3f} ({' '.join(f'{one:.0f}' for one in within.mean(axis=0))})"


if __name__ == "__main__":
    main()
