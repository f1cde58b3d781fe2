"""The paper's model of the residual, eqs. (4) to (6)."""
