"""A simulated OpenIGTLink tracker."""
