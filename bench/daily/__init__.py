"""The work of a day at the bench: look, home, jog, tare, release, calibrate, check the bench, measure a series."""
