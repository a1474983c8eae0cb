"""The frame of all pages: navigation, the choice of a site, and one style, as that of the reports."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from urllib.parse import urlencode

from ..core.html import STYLE
from .raster import HATCH_COLOUR
from .site import Site

PAGES = {"": "Map", "classes": "Classes", "drives": "Drives", "physics": "Explanations"}
"""Pages by path."""

VIEW_STYLE = (
    STYLE
    + """
body{max-width:none;margin:0;padding:0}main{padding:0 1rem 2rem;max-width:76rem;margin:0 auto}
header{display:flex;flex-wrap:wrap;gap:.4rem 1.4rem;align-items:center;padding:.6rem 1rem;background:#16324a;color:#fff}
header b{font-size:1.1rem}header nav{display:flex;gap:.2rem}
header a{color:#fff;padding:.25rem .7rem;border-radius:.3rem;text-decoration:none}
header a:hover{background:#2c5578}header a[aria-current]{background:#fff;color:#16324a;font-weight:600}
header form{margin-left:auto}header select{font:inherit;max-width:16rem}
:focus-visible{outline:3px solid #e69f00;outline-offset:2px}
.synthetic{background:#b00020;color:#fff;padding:.1rem .5rem;border-radius:.3rem;font-weight:600}
#map{display:grid;grid-template-columns:minmax(0,1fr) 25rem;gap:0 1.2rem;max-width:none;padding-top:.6rem}
aside{overflow-y:auto;max-height:calc(100vh - 4.5rem);border-left:1px solid #ddd;padding-left:1rem}
aside h2{margin-top:0;font-size:1.15rem}aside h3{margin-top:1rem}aside h4{margin:.8rem 0 .2rem}
aside p{margin:.3rem 0}aside table{margin:.4rem 0;width:100%}aside .verdict{font-size:1rem}
aside td:last-child{white-space:nowrap}aside img{max-width:100%}aside audio{width:100%}
main img{max-width:100%;height:auto}.row figure{max-width:24rem}
#legend{display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;align-items:center;min-height:3.2rem;margin:.2rem 0 .4rem}
#legend .scale{display:flex;align-items:center;gap:.4rem}#legend .note{flex-basis:100%;margin:0}
.swatch{display:inline-block;width:1.1em;height:1.1em;vertical-align:-.15em;border:1px solid #555;margin-right:.35em}
.bar{display:inline-block;width:11rem;height:1.1em;border:1px solid #555}
.hatched{background:repeating-linear-gradient(-45deg,HATCH 0 2px,#dcdcdc 2px 6px)}
.keys{color:#555;font-size:.93em}kbd{border:1px solid #999;border-radius:.2rem;padding:0 .3em;background:#f4f4f4}
@media(max-width:60rem){#map{grid-template-columns:minmax(0,1fr)}
aside{max-height:none;border-left:0;padding-left:0;border-top:1px solid #ddd;padding-top:.8rem}}
@media print{header form,.keys{display:none}}""".replace("HATCH", HATCH_COLOUR)
)


def header(current: str, site: Site, sites: Sequence[str]) -> str:
    """Give the navigation; `current` is the path of the page that it is on."""
    query = f"?{urlencode({'site': site.name})}" if site.name else ""
    links = "".join(
        f'<a href="{path or "./"}{query}"{" aria-current=page" if path == current else ""}>{title}</a>'
        for path, title in PAGES.items()
    )
    options = "".join(
        f"<option{' selected' if name == site.name else ''}>{escape(name)}</option>" for name in sites
    )  # fmt: skip
    chosen = (
        '<form method=get><label>Site <select name=site onchange="this.form.submit()">'
        f"{options}</select></label><noscript><button>Show</button></noscript></form>"
    )
    if not sites:
        chosen = ""
    mark = "<span class=synthetic>synthetic</span>" if site.synthetic else ""
    return (
        f"<header><b>Bevameter</b><nav aria-label=Pages>{links}</nav>{mark}<span>{escape(site.database.name)}</span>"
        f"{chosen}</header>"
    )


def page(title: str, current: str, site: Site, sites: Sequence[str], body: str) -> str:
    """Give a whole page; `body` is HTML."""
    return (
        "<!doctype html><html lang=en><head><meta charset=utf-8>"
        f"<meta name=viewport content='width=device-width'><title>{escape(title)}</title>"
        f"<style>{VIEW_STYLE}</style></head><body>{header(current, site, sites)}<main>{body}</main></body></html>\n"
    )
