"""Who may act: credentials, rights of routes, limits and the audit log."""
