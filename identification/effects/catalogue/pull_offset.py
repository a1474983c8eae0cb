"""Drawbar-pull offset."""

from ..effect import PULL
from ..registry import register
from ..sensors import SensorOffset


@register
class PullOffset(SensorOffset):
    """The zero of the pull cell is wrong."""

    slug = "pull_offset"
    title = "drawbar-pull offset"
    what_happens = "the zero of the drawbar-pull sensor is wrong"
    check = "read the pull cell with nothing attached to it"
    changes = (PULL,)
    channel, share = PULL, 0.05
