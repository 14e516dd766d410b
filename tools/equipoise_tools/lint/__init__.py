"""Formatting, static analysis, dependency law and house rules, as functions that return findings."""
