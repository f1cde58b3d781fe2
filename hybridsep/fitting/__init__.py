"""From logs to FMUs: identification, choice of settings, replay, report and advice."""
