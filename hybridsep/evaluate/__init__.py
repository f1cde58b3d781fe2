"""Evaluation of predictors and compensators: backtests, scores, plots."""
