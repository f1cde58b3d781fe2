"""Random nonlinear feed drives, and the predictor replayed on each of them."""
