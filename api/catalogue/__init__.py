"""The catalogue: what the folder of sessions holds, as tables to ask, and the names of people, which are only here."""
