"""Sessions by other formulas than the engine's: laws, integrator, bench and noise are written from the literature.

Nothing here imports the project (a test holds that), nor `benchmarks.hidden`, whose formulas are the engine's own.
"""
