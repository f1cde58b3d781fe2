"""Online model averaging of the residual: experts, their stack, and which samples are believed."""
