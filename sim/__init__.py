"""The physics, and the simulated devices that stand before it."""
