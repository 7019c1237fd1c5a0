"""What can be set of the catalogue; help and the service's description say so without loading it."""

ENVIRONMENT = "RIG_CATALOGUE"
USUAL = 100
# A page of a table that a person looks through; more are a script's, which can turn pages.
MOST = 500
