"""Mutation testing: which one-token changes of the firmware its tests notice."""
