"""The paper's cases, co-simulated: what ``hybridsep demo`` runs."""
