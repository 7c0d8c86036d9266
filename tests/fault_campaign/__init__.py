"""Faults at random on protocols at random: what must never bend, seed by seed."""
