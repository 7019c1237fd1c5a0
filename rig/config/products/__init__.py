"""The products that the bench knows, one declaration each."""
