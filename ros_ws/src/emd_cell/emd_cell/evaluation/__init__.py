"""Plans judged by what becomes of them: planned, executed in the cloth simulation, compared."""
