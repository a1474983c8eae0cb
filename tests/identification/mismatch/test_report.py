"""The report of `explain`: that it is whole, says what was found, and lets nothing in from the recording's text."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from bevameter import InputError
from bevameter.identification.effects.catalogue import PHYSICS, SLUGS
from bevameter.identification.mismatch.explanation import Candidate, Estimate, Missing, Region, to_json
from bevameter.identification.mismatch.name.naming import ASSERTED
from bevameter.identification.mismatch.show import pictures, readable
from bevameter.identification.mismatch.show.headline import verdict
from bevameter.identification.mismatch.show.report import report_html, write_report
from bevameter.identification.mismatch.show.tables import fit_rows, located_rows, soil_table
from bevameter.identification.mismatch.show.wording import _statement, summarise, trust
from explanations import SOUND, cannot_tell, explanation, nothing

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Collects the text, what the page asks for from elsewhere, and whether tags are closed in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.feed(page)
        self.close()
        assert self.open == [], self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href", "action", "data", "srcset")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] != ["style"]:
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).replace("\xa0", " ").split())


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(report_html(explanation(sound=SOUND)))


def test_the_page_needs_nothing_from_elsewhere(page):
    assert page.links
    assert all(link.startswith("data:image/png;base64,") for link in page.links)
    assert {"script", "link", "iframe", "object", "form"}.isdisjoint(page.tags)
    style = re.search(r"<style>(.*?)</style>", report_html(explanation()), re.DOTALL).group(1)
    assert "url(" not in style
    assert "@import" not in style


def test_the_pictures_in_the_page_are_pictures(page):
    for link in page.links:
        data = np.frombuffer(base64.b64decode(link.split(",")[1]), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert min(picture.shape[:2]) > 300
        assert picture.std() > 5.0, "not blank"


def test_the_page_says_what_was_found(page):
    for said in (
        "The simulation leaves out slip-sinkage (very likely, 98 %).",
        "Sinkage leaves the simulation above slip 0.3.",
        "0.3 to 0.55", "97 %", "< 1e-12", "12 cycles a turn of the wheel",
        "n = n0 + n1 |i|", "Ding et al. (2010)", "0.213 ± 0.019",
        "2.8 (2.4 to 3.3)", "0.51 (0.48 to 0.56)",
        "held-out data do not ask", "bulldozing (wedge)",
        "2.10 ± 0.30", "0.512 ± 0.083", "kPa", "21.0 ± 1.7", "deg",
        "Held-out rows are predicted to within noise.",
        "240 ± 21 nats", "12 stretches of time held out in turn", "3 rows without load or slip are left out",
        "rows compared 400", "seed 7", "seconds 12.3", "Bevameter 0.1.0",
        "gear mesh: very likely, 97 %", "8 dB before, 5.7 dB after",
    ):  # fmt: skip
        assert said in page.text, said


def test_the_page_does_not_guess_where_the_data_come_from(page):
    assert "real wheel or from another simulator, the recording does not say" in page.text


def test_nothing_found_is_said_so_and_nothing_is_shown_as_added():
    text = Page(report_html(nothing())).text
    assert "Nothing that held-out data ask for is missing from the simulation." in text
    assert "What was left out" not in text
    assert "with what was left out" not in text
    assert "Nothing was added" in text


def test_what_comes_nearest_is_told_where_channels_are_missed_and_too_little_asks_for_it():
    missed = {
        name: replace(fit, rmse_before=3.0 * fit.noise, rmse_after=3.0 * fit.noise)
        for name, fit in nothing().fits.items()
    }
    likely = Candidate("slip_sinkage[exponent]", "physics", 0.47, 8.0, {}, "held-out data do not ask for it")
    said = summarise(replace(nothing(), fits=missed, candidates=(likely,)))
    assert said.endswith("Slip-sinkage (exponent) comes nearest (47 %): more rows would tell.")
    unlikely = replace(likely, probability=0.05)
    assert summarise(replace(nothing(), fits=missed, candidates=(unlikely,))).endswith("to be named.")


def test_rivals_are_summed_up_as_physics_or_fault():
    both = summarise(cannot_tell())
    assert "physics has 55 %, that it is a fault of an instrument or of what is configured 42 %." in both
    first, second = cannot_tell().missing
    one = replace(first, indistinguishable_from=("bulldozing",))
    alike = replace(cannot_tell(), missing=(one, replace(second, effect="bulldozing", kind="physics")))
    assert "Whichever it is, it is physics." in summarise(alike)
    doubted = tuple(replace(each, probability=0.24) for each in alike.missing)
    assert "Whichever" not in summarise(replace(alike, missing=doubted)), "it may be neither"
    beside = replace(cannot_tell(), missing=(first, replace(second, kind="unknown", effect="unknown")))
    assert "physics has" not in summarise(beside)
    assert "Whichever" not in summarise(beside)
    two = replace(cannot_tell(), missing=(replace(first, indistinguishable_from=()), second))
    assert "physics has" not in summarise(two), "both may be missing"


def test_a_tie_names_both_with_their_shares_and_what_would_tell():
    text = Page(report_html(cannot_tell())).text
    assert "Something was left out, but these data do not tell what" in text
    assert "side-wall friction (about as likely as not, 55 %); torque gain (about as likely as not, 42 %)" in text
    assert "These data do not tell it from: torque gain." in text
    assert "What would tell: measure drawbar pull (drawbar_pull_N) on the same drive." in text
    assert "tau_s 0.90 ± 0.20 kPa" in text


def test_an_instrument_and_a_physics_are_told_apart_and_doubt_is_not_asserted():
    physics, fault = cannot_tell().missing
    both = explanation(missing=(replace(physics, probability=0.97), replace(fault, probability=0.96)))
    assert verdict(both) == (
        "The simulation leaves out side-wall friction (very likely, 97 %); an instrument or a configured value is at "
        "fault: torque gain (very likely, 96 %)."
    )
    doubtful = explanation(missing=(replace(physics, probability=0.97), replace(fault, probability=0.3)))
    assert verdict(doubtful).endswith("considered, but not asserted: torque gain (unlikely, 30 %).")


def test_parameters_are_vouched_for_only_where_nothing_beside_them_is_doubtful():
    physics, fault = cannot_tell().missing
    sure = explanation(missing=(replace(physics, probability=0.97),))
    assert trust(sure).endswith("some errors of them look wholly like another soil.")
    doubtful = explanation(missing=(replace(physics, probability=0.97), replace(fault, probability=0.6)))
    assert "not measurements of the ground" in trust(doubtful)


def test_the_unknown_is_described():
    shape = Missing("unknown", "unknown", "", 0.93, {}, "f", "fitted", (), "", "torque_Nm rises with slip")
    text = Page(report_html(explanation(verdict="unknown", missing=(shape,)))).text
    assert "nothing in the catalogue explains it well enough (very likely, 93 %)" in text
    assert "Shape: torque_Nm rises with slip." in text


def test_a_channel_that_is_predicted_worse_is_said_so():
    base = explanation()
    worse = replace(base.fits["torque_Nm"], rmse_before=1.0, rmse_after=1.2)
    text = Page(report_html(replace(base, fits={**base.fits, "torque_Nm": worse}))).text
    assert "torque T is predicted worse than before." in text
    assert "Where points lie farther from zero on the right than on the left" in text, "or the pictures seem wrong"
    assert "predicted worse" not in Page(report_html(base)).text
    assert "farther from zero" not in Page(report_html(base)).text
    nothing = replace(base, verdict="none", missing=(), fits={**base.fits, "torque_Nm": worse})
    assert "predicted worse" not in Page(report_html(nothing)).text, "nothing was added that could be worse"


def test_text_from_files_is_escaped():
    nasty = "<script>alert('x')</script>"
    base = explanation()
    answer = replace(
        base, source=f"folder/{nasty}.csv", summary=nasty, notes=(nasty,), trust=nasty, split=nasty,
        missing=(
            replace(base.missing[0], form=nasty, equation=nasty, source=nasty, description=nasty, would_tell=nasty),
        ),
        candidates=(replace(base.candidates[0], why=nasty, effect=f"soil_patch[{nasty}]"),),
        sound={**SOUND, "notes": [nasty], "verdict": nasty},
    )  # fmt: skip
    page = report_html(answer)
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert "script" not in Page(page).tags


def test_the_report_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    write_report(explanation(), path)
    before = path.read_text(encoding="utf-8")
    assert before == report_html(explanation()), "the same answer gives the same page"
    with pytest.raises(InputError, match="no folder"):
        write_report(explanation(), tmp_path / "nowhere" / "report.html")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("bevameter.framework.core.files.os.replace", fail)
    with pytest.raises(InputError, match="disk full"):
        write_report(nothing(), path)
    assert path.read_text(encoding="utf-8") == before
    assert [each.name for each in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize("rows", [1, 12])
def test_few_rows_and_constant_or_absent_variables_are_drawn_all_the_same(rows):
    base = explanation()
    few = replace(
        base.rows,
        variables={"slip": np.full(rows, 0.2), "load_N": np.full(rows, np.nan)},
        measured=base.rows.measured[:rows], before=base.rows.before[:rows], after=base.rows.after[:rows],
    )  # fmt: skip
    text = Page(report_html(replace(base, rows=few))).text
    assert "Prediction of held-out rows" in text


def test_every_located_channel_and_variable_is_drawn_and_every_other_channel_too():
    drawn = [(channel, variable) for channel, variable, _ in pictures.residual_maps(explanation())]
    assert drawn == [("sinkage_m", "slip"), ("torque_Nm", "wheel_angle_rad"), ("drawbar_pull_N", "slip")]


def test_bins_hold_their_rows_mean_and_interval(rng):
    along = rng.uniform(0.0, 1.0, 6000)
    values = 3.0 * along + rng.normal(size=6000)
    middle, mean, half = pictures.bin_means(along, values)
    assert len(middle) == 12
    assert np.all(np.diff(middle) > 0.0)
    assert np.mean(np.abs(mean - 3.0 * middle) < half) >= 0.75
    np.testing.assert_allclose(half, 1.96 / np.sqrt(500.0), rtol=0.15)
    repeats = np.repeat([0.0, 0.5, 1.0], 4) + 1e-3 * rng.normal(size=12)
    middle, mean, half = pictures.bin_means(repeats, np.repeat([1.0, 2.0, 3.0], 4))
    np.testing.assert_allclose(mean, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(half, 0.0, atol=1e-12)
    _, _, half = pictures.bin_means(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    assert np.isnan(half).all(), "two rows give no interval"


def test_every_effect_of_the_catalogue_has_its_words():
    assert set(readable.EFFECTS) == {*SLUGS, "unknown"}
    assert readable.effect("slip_sinkage[exponent] + grousers[ripple, 18 lugs]") == (
        "slip-sinkage (exponent) + grousers (ripple, 18 lugs)"
    )
    assert readable.effect("something_new") == "something_new"


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("phi_rad", Estimate(np.radians(31.2), np.radians(1.3), "rad"), "friction angle phi = 31.2 ± 1.3 deg"),
        ("z_0", Estimate(0.0032, 0.00021, "m"), "z_0 = 3.20 ± 0.21 mm"),
        ("from", Estimate(12.31, 0.4, "m"), "from = 12.31 ± 0.40 m"),
        ("compliance", Estimate(5e-5, 1e-5, "m/N"), "compliance = 50 ± 10 mm/kN"),
        ("c_Pa", Estimate(1234.0, np.nan, "Pa"), "cohesion c = 1.23 (sd unknown) kPa"),
        ("k_m", Estimate(0.012, 0.0, "m"), "shear modulus k = 12 (given) mm"),
        ("T_0", Estimate(np.nan, 1.0, "N m"), "T_0 = unknown N m"),
        ("stiffness_Pa", Estimate(2.31e6, 1.2e5, "Pa"), "stiffness k1 + k2 b = 2310 ± 120 kPa"),
    ],
)
def test_quantities_read_as_people_write_them(name, value, expected):
    assert readable.estimate(name, value) == expected


@pytest.mark.parametrize(
    ("probability", "words"),
    [(1.0, "virtually certain, > 99.5 %"), (0.95, "very likely, 95 %"), (0.5, "about as likely as not, 50 %"),
     (0.001, "exceptionally unlikely, < 0.5 %"), (0.0, "exceptionally unlikely, < 0.5 %")],
)  # fmt: skip
def test_a_probability_is_said_in_words_and_never_as_certain(probability, words):
    assert readable.likelihood(probability) == words


def test_the_tables_are_in_the_units_of_their_headers():
    answer = explanation(located=(Region("sinkage_m", "pitch_rad", 0.0, np.radians(10.0), 0.5, 0.004, -3.0),))
    assert located_rows(answer) == [
        ["sinkage z [mm]", "slope along the track [deg]", "0 to 10 deg", "50 %", "-3.0", "0.004"]
    ]
    assert fit_rows(answer)[1] == ["sinkage z [mm]", "2.8 (2.4 to 3.3)", "0.51 (0.48 to 0.56)", "0.5", "396"]
    headers, rows = soil_table(nothing())
    assert all(len(row) == len(headers) == 3 for row in rows)
    # Page, text and JSON give one interval.
    apart = replace(nothing(), soil={**nothing().soil, "c_Pa": Estimate(500.0, 90.0, "Pa")})
    assert readable.spread(500.0, 90.0, 1e-3) in next(row for row in soil_table(apart)[1] if "c" in row[0].split())


def test_the_page_of_the_documentation_lists_every_effect_in_the_same_words():
    page = (Path(__file__).resolve().parents[3] / "docs" / "explain.md").read_text(encoding="utf-8")
    rows = [line for line in page.split("## The effects")[1].splitlines() if line.startswith("| `")]
    assert rows == [
        f"| `{slug}` | {'physics' if slug in PHYSICS else 'instrument'} | {readable.EFFECTS[slug][1]} |"
        for slug in SLUGS
    ]
    assert f"**asserted** from {100 * ASSERTED:.0f} %" in page
    keys = set(re.findall(r"`(\w+)`", page.split("## The JSON")[1].split("## ")[0]))
    answer = to_json(explanation(sound=SOUND))
    parts = (answer["located"][0], answer["missing"][0], answer["candidates"][0], answer["fit"])
    fits = answer["fit"]["channels"]["torque_Nm"]
    assert {*answer, *fits, *(key for part in parts for key in part)} - {"channels"} <= keys


@pytest.mark.parametrize(("count", "said"), [(1, ""), (4, "and 1 more parameter."), (6, "and 3 more parameters.")])
def test_parameters_beyond_the_first_few_are_counted(count, said):
    values = {f"d{number}": Estimate(0.5, 0.1, "") for number in range(count)}
    stated = _statement(Missing("drift", "instrument", "torque_Nm", 0.9, values, "", ""))
    assert stated.endswith(said or "d0 = 0.50 ± 0.10.")
    assert ("more parameter" in stated) == bool(said)
