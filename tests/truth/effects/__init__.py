"""Hidden effects: each id of the catalogue in several shapes, written from the literature. Sources are in the modules.

Every module in this folder is imported, and what it registers can be asked of `tests.truth.cases`: an effect outside
the catalogue is one more file here.
"""

from importlib import import_module
from pkgutil import iter_modules

from .registry import EFFECTS, HALVES, Build, Effect, effect, judge_effect, judge_shapes, more_shapes

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = ["EFFECTS", "HALVES", "Build", "Effect", "effect", "judge_effect", "judge_shapes", "more_shapes"]
