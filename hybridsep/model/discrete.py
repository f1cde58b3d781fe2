"""Discrete-time physics model under a zero- or first-order hold, exact at the samples; eq. (2)."""

from collections import deque
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..base.settings import check
from ..base.signals import Array

BLOCK_MAX = 256  # largest size of the lifted matrices, for memory's sake; longer windows are split into blocks

StateSpace = tuple[Array, Array, Array]


class DiscreteModel:
    """Discrete-time model ``x_pb = G_pb x_d``, eq. (2); its state is carried from window to window.

    ``s(k+1) = A s(k) + b u(k)``, ``x_pb(k) = c s(k) + d u(k)``, ``u`` being ``x_d`` after the dead time, in its
    lifted form over a window: ``x_pb = O s + T u`` with ``T`` lower-triangular Toeplitz.

    Positions are relative to the initial position; the state is plain data, ``(n_state,)``. ``state_space`` is
    :meth:`ModalModel.state_space`, block diagonal, ``dead_time`` in samples, ``T_s`` in s, ``input_hold`` zero-order
    ("zoh") or first-order ("foh"); windows of up to ``block`` samples are computed in one piece.

    ParameterError if ``T_s`` is out of its range or the hold is unknown.
    """

    def __init__(
        self, state_space: StateSpace, dead_time: int, T_s: float, input_hold: str = "zoh", block: int = BLOCK_MAX
    ) -> None:
        self.T_s: float = check("T_s", T_s)
        self.input_hold: str = check("input_hold", input_hold)
        self.dead_time = dead_time
        A, b, c = state_space
        self.A, self.b, self.c, self.d = np.zeros_like(A), np.zeros_like(b), c, 0.0
        for i in range(0, len(b), 2):  # each mode by the matrix exponential of its augmented system (Van Loan)
            mode = slice(i, i + 2)
            self.A[mode, mode], self.b[mode], d = discretised_block(A[mode, mode], b[mode], self.T_s, input_hold)
            self.d += float(c[mode] @ d)
        self._n = len(self.b)
        self._block = min(check("Np", block, label="block"), BLOCK_MAX)
        # Lifted matrices for windows of up to ``block`` samples
        m, n = self._block, self._n
        self._powers = np.empty((m + 1, n, n))  # A⁰ … Aᵐ
        self._powers[0] = np.eye(n)
        for power, following in pairwise(self._powers):
            self.A.dot(power, following)  # in a third of the time of @
        self._O = np.ascontiguousarray(self.c @ self._powers[:m])  # row i: c Aⁱ
        self._K = np.ascontiguousarray((self._powers[:m] @ self.b)[::-1].T)  # [Aᵐ⁻¹b … A b, b]
        markov = np.concatenate(([self.d], self._O[: m - 1] @ self.b))  # d, c b, c A b, …
        # Row i: markov[i], markov[i − 1], …, 0; SciPy's toeplitz takes ten times as long
        lagged = sliding_window_view(np.concatenate((np.zeros(m - 1), markov)), m)
        self._T = np.ascontiguousarray(lagged[:, ::-1])

    @property
    def n_state(self) -> int:
        """Length of the state: two per mode, and the commands within the dead time."""
        return self._n + self.dead_time

    def rest(self, *m: int) -> Array:
        """Return the state of a drive at rest at position 0, ``(n_state,)``; of ``m`` drives, ``(n_state, m)``."""
        return np.zeros((self.n_state, *m))

    def forced_response(self, state: Array, x_d: Array) -> tuple[Array, Array]:
        """Return the response over a window, free response included, and the state at its end; eq. (2).

        ``state``: (n_state,) or (n_state, m), m: from :meth:`rest` or an earlier call; not changed; ``x_d``: (n,) or
        (n, m), m: commanded positions, any length; each column is a signal of its own. Returns ``x_pb``: (n,) or (n,
        m), m; ``state``: (n_state,) or (n_state, m), m: initial state of the next window.
        """
        n = len(x_d)
        s, u, register = state, x_d, state[:0]
        if self.dead_time:
            line = np.concatenate((state[self._n :], x_d))
            s, u, register = state[: self._n], line[:n], line[n:]
        if n <= self._block:
            x_pb, s = self._block_response(s, u)
        else:
            x_pb = np.empty(x_d.shape)
            for i in range(0, n, self._block):
                stop = min(i + self._block, n)
                x_pb[i:stop], s = self._block_response(s, u[i:stop])
        return x_pb, (np.concatenate((s, register)) if self.dead_time else s)

    def stepper(self) -> Callable[[float], float]:
        """Return a function of the next command that gives the position under it, from rest on, sample by sample.

        It gives what :meth:`forced_response` does, in a fifth of its time.
        """
        s, late, now, by_command = np.zeros(self._n), deque([0.0] * self.dead_time), self._O[0], self._K[:, -1]

        def step(command: float) -> float:
            nonlocal s
            late.append(command)
            command = late.popleft()
            x_pb = float(now.dot(s)) + self.d * command
            s = self.A.dot(s) + by_command * command
            return x_pb

        return step

    def impulse_response(self, n: int) -> Array:
        """Return the first column of the lower-triangular Toeplitz ``G_pb`` of a window, ``(n,)``, m/m."""
        return self.forced_response(self.rest(), np.eye(1, n)[0])[0]

    def _block_response(self, s: Array, u: Array) -> tuple[Array, Array]:
        n = len(u)
        return self._O[:n] @ s + self._T[:n, :n] @ u, self._powers[n] @ s + self._K[:, self._block - n :] @ u


def discretised_block(A: Array, b: Array, T_s: float, input_hold: str) -> tuple[Array, Array, Array]:
    """Return ``(A_d, b_d, d)`` with ``s(k+1) = A_d s(k) + b_d u(k)`` and the continuous state ``s(k) + d u(k)``.

    ``A``, (m, m), and ``b``, (m,), are in 1/s, ``T_s`` in s.
    """
    from scipy.linalg import expm

    m = len(b)
    augmented = np.zeros((m + 2, m + 2))
    augmented[:m, :m] = A * T_s
    augmented[:m, m] = b * T_s
    augmented[m, m + 1] = 1.0  # the ramp from u(k) to u(k+1)
    exponential = expm(augmented)
    phi, gamma_1, gamma_2 = exponential[:m, :m], exponential[:m, m], exponential[:m, m + 1]
    if input_hold == "zoh":
        return phi, gamma_1, np.zeros(m)
    # ξ(k+1) = Φ ξ + Γ₁ u(k) + Γ₂ (u(k+1) − u(k)); with s = ξ − Γ₂ u it needs no future command.
    return phi, phi @ gamma_2 + gamma_1 - gamma_2, gamma_2
