"""What of the map page runs in the browser: keys that act on the map, and text that leaves Bokeh's shadow trees."""

from __future__ import annotations

from collections.abc import Sequence

from bokeh.models import CustomJS, Div

_MIRROR = "const place = document.getElementById(cb_obj.name); if (place) place.innerHTML = cb_obj.text;"

_LISTEN = """
for (const each of mirrored) document.getElementById(each.name).innerHTML = each.text;
const map = document.getElementById("area");
const known = new Set(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "+", "-", "0"]);
let presses = 0;
map.addEventListener("keydown", (event) => {
  const at = event.composedPath()[0];
  if (["INPUT", "SELECT", "TEXTAREA"].includes(at.tagName) || event.ctrlKey || event.altKey || event.metaKey) return;
  if (!known.has(event.key)) return;
  event.preventDefault();
  keys.text = (event.shiftKey && event.key.startsWith("Arrow") ? "Shift+" : "") + event.key + " " + ++presses;
});
map.addEventListener("pointerdown", () => map.focus({preventScroll: true}));
document.body.dataset.ready = "yes";
"""


def mirror(model: Div) -> CustomJS:
    """Show the text of a model in the element of the page that has its name as identity."""
    return CustomJS(args={"model": model}, code=_MIRROR)


def key_listener(keys: Div, mirrored: Sequence[Div]) -> CustomJS:
    """Send each key that is pressed while the map has the focus, with its number, as the text of `keys`."""
    return CustomJS(args={"keys": keys, "mirrored": list(mirrored)}, code=_LISTEN)
