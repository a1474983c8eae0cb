"""Physics and instrument faults that the textbook wheel leaves out.

`effect` has the base class, `registry` the registry and `catalogue` one module per effect. `parse` reads effects named
on the command line, `stored` has the document of a fitted simulator.
"""

from .effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Contact, Drive, Effect, Parameter, Situation
from .registry import register

__all__ = [
    "LOAD", "PULL", "SINKAGE", "SLIP", "TORQUE", "Contact", "Drive", "Effect", "Parameter", "Situation", "register",
]  # fmt: skip
