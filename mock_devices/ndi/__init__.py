"""Mock of NDI's Polaris and Vega."""
