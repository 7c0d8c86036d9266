"""The campaign that judges the diagnosis: hidden effects of the independent simulator, found or not, counted."""
