"""Error against run time: settings compared, measured, drawn and tabulated."""
