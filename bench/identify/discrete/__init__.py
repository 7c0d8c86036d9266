"""The paper's discrete Hammerstein model (13) and the methods that identify it, with one that is consistent.

series, system, linear, search     data on a grid; the model and its cost (16); the two steps; the whole search
noniterative, iterative, fast, iv  one file a method, each with a `fit`
outcome                            laws and orders compared, the result in the form of fit.json
over_time                          the numbers against the sample time
"""

from .noniterative import Start
from .over_time import OverSampleTimes, over_sample_times

__all__ = ["OverSampleTimes", "Start", "over_sample_times"]
