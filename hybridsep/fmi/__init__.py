"""FMUs: one variable table each, from which the modelDescription, the slave and the documentation follow."""
