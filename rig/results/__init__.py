"""What was found, as types: saved once as JSON, rendered by terminal, HTML, CSV and REST, never computed again."""
