"""The default filter of the MBBR beside an unscented and an error-state one, on the same recorded samples."""
