"""Several instances in one process, in every implementation: none sees another."""

import pytest
from driving import SHORT, T_S, set_inputs, steps
from stream import COMPENSATOR, DRIVE, LOOK_AHEADS, PLANTS, PREDICTOR, STAGE, STAGE_COMPENSATOR, STAGE_PREDICTOR, Value
from streams import StreamMaker, on_all

OTHERS = {PREDICTOR: STAGE_PREDICTOR, COMPENSATOR: STAGE_COMPENSATOR, DRIVE: STAGE, STAGE: DRIVE}
N_SAMPLES = 130


def instances_of(model: str) -> list[tuple[str, dict[str, Value], float]]:
    """Return model, parameters and position of rest, m, of instances that run side by side."""
    if model in PLANTS:
        return [(model, {"seed": 1}, 0.0), (OTHERS[model], {}, 0.2), (model, {"seed": 2}, 0.2), (model, {}, 0.0)]
    short = SHORT[model]
    return [
        (model, short, 0.0),
        (OTHERS[model], short, 0.1),
        (model, {**short, "Np": 30, "p": 11, "q": 4}, -0.1),
        (model, {**short, "lambda": 1e-9}, 0.0),
        (model, {}, 0.5),
    ]


@pytest.mark.slow
@on_all((*LOOK_AHEADS, *PLANTS))
def test_instances_side_by_side_do_what_each_does_alone(new_stream: StreamMaker) -> None:
    kinds = instances_of(new_stream.model)
    position = "x_d" if new_stream.model in PLANTS else "x_d_ahead"
    expected = []
    for model, values, rest in kinds:
        alone = new_stream(model)
        alone.initialise({**values, position: rest})
        expected.append(steps(alone, 0, N_SAMPLES, rest))
        alone.close()
    together = [new_stream(model) for model, _, _ in kinds]
    for stream, (_, values, rest) in zip(together, kinds, strict=True):
        stream.initialise({**values, position: rest})
    rows: list[list[list[float]]] = [[] for _ in kinds]
    for k in range(N_SAMPLES):
        for stream, (_, _, rest) in zip(together, kinds, strict=True):
            set_inputs(stream, k * T_S, rest)
        for stream, row in zip(together, rows, strict=True):
            stream.step(k * T_S, T_S)
            row.append(stream.outputs())
    assert rows == expected
    assert len({str(row) for row in rows}) == len(kinds)
