"""Physics and instrument faults that the textbook wheel leaves out.

`effect` has the base class, `registry` the registry, `catalogue` one module an effect, `parse` reads effects named on
the command line, `stored` keeps what was found.
"""

from .effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Contact, Drive, Effect, Parameter, Situation
from .registry import register

__all__ = [
    "LOAD", "PULL", "SINKAGE", "SLIP", "TORQUE", "Contact", "Drive", "Effect", "Parameter", "Situation", "register",
]  # fmt: skip
