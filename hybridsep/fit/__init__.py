"""From logs of an axis to its model, its FMUs and a report."""
