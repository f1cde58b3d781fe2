"""What predictors and compensators are worth: backtests, closed loops, figures."""
