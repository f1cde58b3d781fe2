"""Many logs of many machines: where they are, who works on them, and what came of it."""
