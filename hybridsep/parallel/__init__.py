"""Many tasks at once: processes of this machine, or a cluster."""
