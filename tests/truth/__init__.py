"""An independent truth: pads, motions and noise to test estimators with.

Nothing here imports the packages under test. Units: mm, N, s. Depth grows into the pad, force is positive in
compression, 0 mm is the pad's virgin surface.
"""
