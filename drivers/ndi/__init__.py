"""NDI Polaris and Vega position sensors through the combined API, over a serial line or TCP."""
