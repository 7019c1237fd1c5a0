"""What tests and benchmarks measure by: made sessions, loadings, clocks and subjects, each from formulas of its own."""
