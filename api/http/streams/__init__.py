"""Live samples and events to any number of clients, none of which can hold up the bench or each other."""
