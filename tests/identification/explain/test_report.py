"""The report of `explain`: it is complete, shows the findings, and escapes the recording's text."""

from __future__ import annotations

import base64
import math
import re
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
from bevameter import InputError
from bevameter.framework.core.explanation import ASSERTED
from bevameter.identification.effects.catalogue import REGISTRY
from bevameter.identification.explain.explanation import Candidate, Estimate, Region, Screened
from bevameter.identification.explain.quantities import effect, estimate, number, p_value, shown, with_sd
from bevameter.identification.explain.report import pictures
from bevameter.identification.explain.report.page import report_html, write_report
from bevameter.identification.explain.report.tables import fit_table, located_table, soil_table
from bevameter.identification.explain.words import headline, measurement
from explanations import SOUND, cannot_tell, explanation, nothing, several, unknown, with_soil

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
def html() -> str:
    return report_html(explanation(sound=SOUND))


@pytest.fixture(scope="module")
def page(html) -> Page:
    return Page(html)


@pytest.fixture
def undrawn(monkeypatch):
    """Leave the pictures out, which take longest."""
    monkeypatch.setattr(pictures, "residual_maps", lambda _: [])
    monkeypatch.setattr(pictures, "channels_over", lambda _: None)
    for name in ("held_out_errors", "predicted_against_measured"):
        monkeypatch.setattr(pictures, name, lambda _: b"")


def test_the_page_is_self_contained(html, page):
    assert page.links
    assert all(link.startswith("data:image/png;base64,") for link in page.links)
    assert {"script", "link", "iframe", "object", "form"}.isdisjoint(page.tags)
    style = re.search(r"<style>(.*?)</style>", html, re.DOTALL).group(1)
    assert "url(" not in style
    assert "@import" not in style


def test_the_pictures_in_the_page_are_pictures(page):
    assert len(page.links) == 6, "the channels, three channels' residuals, errors, predictions"
    for link in page.links:
        data = base64.b64decode(link.split(",")[1])
        assert data.startswith(b"\x89PNG")
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert min(picture.shape[:2]) > 300
        assert picture.std() > 5.0, "not blank"


def test_the_page_shows_what_was_found(page):
    for said in (
        headline(explanation()), explanation().trust, "0.3 to 0.55", "97 %", "< 1e-12", "12 cycles a turn of the wheel",
        "n = n0 + n1 |i|", "Ding et al. (2010)", "0.213 ± 0.019", "2.8 (2.4 to 3.3)", "0.51 (0.48 to 0.56)",
        "bulldozing (wedge) physics < 0.5 % -1.5 -2.0 s = 0.10 ± 0.40", "slip-sinkage (exponent) physics 98 % +236.0",
        "2.10 ± 0.30", "0.512 ± 0.083", "kPa", "21.0 ± 1.7", "deg", "240 ± 21 nats",
        "12 stretches of time held out in turn", "3 rows without load or slip are left out",
        "rows compared 400", "seed 7", "seconds 12.3", "Gear mesh: 97 %", "8 dB before, 5.7 dB after",
    ):  # fmt: skip
        assert said in page.text, said


@pytest.mark.parametrize("answer", [nothing(), cannot_tell(), unknown(), several()], ids=lambda each: each.verdict)
def test_every_verdict_has_its_page_with_the_answer_first(answer):
    text, first = Page(report_html(answer)).text, headline(answer)
    assert first in text[: text.index(answer.trust)]
    for each in answer.missing:
        assert each.effect in text
        assert measurement(each) in text
    assert len(soil_table(answer)[0]) == (4 if answer.missing else 3), "one soil where nothing was added"


@pytest.mark.usefixtures("undrawn")
def test_a_proposed_drive_names_quantities_instead_of_columns():
    (found,) = unknown().missing
    assert "rim_speed_m_s" in found.would_tell
    assert found.would_tell not in Page(report_html(unknown())).text


@pytest.mark.usefixtures("undrawn")
def test_alternatives_and_what_separates_them_are_shown():
    text = Page(report_html(cannot_tell())).text
    assert "torque gain" in text
    assert cannot_tell().missing[0].would_tell in text
    assert "tau_s 0.90 ± 0.20 kPa" in text


@pytest.mark.usefixtures("undrawn")
def test_a_channel_that_is_predicted_worse_is_reported():
    fits = {**explanation().fits, "torque_Nm": replace(explanation().fits["torque_Nm"], rmse_before=0.4)}
    assert "<p class=warn>" in report_html(explanation(fits=fits))
    assert "<p class=warn>" not in report_html(explanation())


@pytest.mark.usefixtures("undrawn")
def test_candidates_beyond_the_first_unfold_and_what_was_not_fitted_is_listed():
    many = tuple(Candidate(f"soil_patch[{number}]", "physics", 0.01, 1.0, math.nan, {}) for number in range(40))
    html = report_html(explanation(candidates=many, screened=(Screened("time_lag[load_N]", 0.3),)))
    text = Page(html).text
    assert all(f"({number})" in text for number in range(40))
    assert "<details>" in html
    assert "time lag (load_N) (+0.3)" in text


@pytest.mark.usefixtures("undrawn")
def test_text_from_files_is_escaped():
    nasty = "<script>alert('x')</script>"
    base = explanation()
    answer = replace(
        base, source=f"folder/{nasty}.csv", summary=nasty, notes=(nasty,), trust=nasty, split=nasty,
        missing=(
            replace(
                base.missing[0], form=nasty, equation=nasty, source=nasty, description=nasty, would_tell=nasty,
                parameters={nasty: Estimate(1.0, 0.1, nasty)}, indistinguishable_from=(nasty,),
            ),
            replace(unknown().missing[0], description=nasty, would_tell=nasty, effect=nasty),
        ),
        candidates=(replace(base.candidates[0], effect=f"soil_patch[{nasty}]", kind=nasty),),
        screened=(Screened(nasty, 1.0),),
        sound=replace(SOUND, notes=(nasty,), missing=(replace(SOUND.missing[0], effect=nasty, source=nasty),)),
    )  # fmt: skip
    page = report_html(answer)
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert "script" not in Page(page).tags


@pytest.mark.usefixtures("undrawn")
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
def test_few_rows_and_constant_or_absent_variables_are_drawn(rows):
    base = explanation()
    few = replace(
        base.rows,
        variables={"slip": np.full(rows, 0.2), "load_N": np.full(rows, np.nan)},
        measured=base.rows.measured[:rows], before=base.rows.before[:rows], after=base.rows.after[:rows],
    )  # fmt: skip
    assert len(Page(report_html(replace(base, rows=few))).links) >= 2


def test_unknown_values_are_drawn_and_shown():
    base, nan = explanation(), math.nan
    empty = replace(base.rows, measured=np.full_like(base.rows.measured, nan), noise=np.full(3, nan))
    fits = {
        name: replace(fit, rmse_before=nan, rmse_after=nan, noise=nan, before_interval=(nan, nan),
                      after_interval=(nan, nan))
        for name, fit in base.fits.items()
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        page = report_html(
            replace(
                base, rows=empty, fits=fits, heldout_nats=Estimate(nan, nan),
                located=(Region("torque_Nm", "slip", 0.1, 0.2, 1.0, nan, nan),),
                missing=(replace(base.missing[0], parameters={"n1": Estimate(nan, nan)}),),
                grounds=with_soil(base, c_Pa=Estimate(nan, nan, "Pa")).grounds,
            )
        )  # fmt: skip
    text = Page(page).text
    assert "unknown" in text
    assert "nan" not in text


def test_every_located_channel_and_variable_is_drawn_and_every_other_channel_too():
    drawn = [(channel, variable) for channel, variable, _ in pictures.residual_maps(explanation())]
    assert drawn == [("sinkage_m", "slip"), ("torque_Nm", "wheel_angle_rad"), ("drawbar_pull_N", "slip")]


def test_the_first_picture_is_measured_against_simulated(monkeypatch):
    answer = explanation()
    over = dict(zip(answer.rows.channels, pictures.channels_over(answer)[1], strict=True))
    assert over == {"torque_Nm": "wheel_angle_rad", "sinkage_m": "slip", "drawbar_pull_N": "slip"}
    located = replace(answer, located=(Region("sinkage_m", "torque_Nm", 1.0, 2.0, 1.0, 0.01, 3.0),))
    assert set(pictures.channels_over(located)[1]) == {"slip"}, "no answer is drawn over another one"
    page = report_html(answer)
    assert page.index("<figure>") < page.index("Where simulation and recording differ")
    still = {name: np.full(len(values), 0.2) for name, values in answer.rows.variables.items()}
    assert pictures.channels_over(replace(answer, rows=replace(answer.rows, variables=still))) is None


def test_trials_at_a_few_loads_have_a_curve_each(rng):
    loads = np.repeat([60.0, 100.0, 200.0], 6) * (1.0 + 0.01 * rng.standard_normal(18))
    masks = pictures.few_levels(loads)
    assert [int(mask.sum()) for mask in masks] == [6, 6, 6]
    assert [round(float(loads[mask].mean()), -1) for mask in masks] == [60.0, 100.0, 200.0]
    for drive in (rng.uniform(60.0, 200.0, 300), np.full(20, np.nan), np.array([])):
        (whole,) = pictures.few_levels(drive)
        assert whole.all()


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


def test_effects_are_named_with_their_forms():
    assert effect("slip_sinkage[exponent] + grousers[ripple, 18 lugs]") == (
        "slip-sinkage (exponent) + grousers (ripple, 18 lugs)"
    )
    assert effect("something_new") == "something_new"


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("phi_rad", Estimate(np.radians(31.2), np.radians(1.3), "rad"), "friction angle phi = 31.2 ± 1.3 deg"),
        ("z_0", Estimate(0.0032, 0.00021, "m"), "z_0 = 3.20 ± 0.21 mm"),
        ("from", Estimate(12.31, 0.4, "m"), "from = 12.31 ± 0.40 m"),
        ("soil_patch.from", Estimate(12.31, 0.4, "m"), "soil_patch.from = 12.31 ± 0.40 m"),
        ("compliance", Estimate(5e-5, 1e-5, "m/N"), "compliance = 50 ± 10 mm/kN"),
        ("c_Pa", Estimate(1234.0, np.nan, "Pa"), "cohesion c = 1.23 (sd unknown) kPa"),
        ("k_m", Estimate(0.012, 0.0, "m"), "shear modulus k = 12 (given) mm"),
        ("T_0", Estimate(np.nan, 1.0, "N m"), "T_0 = unknown N m"),
        ("stiffness_Pa", Estimate(2.31e6, 1.2e5, "Pa"), "stiffness k1 + k2 b = 2310 ± 120 kPa"),
    ],
)
def test_quantities_read_as_people_write_them(name, value, expected):
    assert estimate(name, value) == expected


def test_numbers_have_the_digits_that_they_deserve():
    assert [number(value) for value in (1234.0, 0.00012, 1e9, math.nan)] == ["1230", "0.00012", "1e+09", "unknown"]
    assert with_sd(123456.0, 2100.0) == "123500 ± 2100"
    assert [p_value(value) for value in (0.0, 2e-5, 0.0123)] == ["< 1e-12", "2e-05", "0.012"]
    assert shown("sinkage_m").label == "sinkage z [mm]"
    assert shown("pass").label == "number of the pass"


def test_the_tables_are_in_the_units_of_their_headers():
    answer = explanation(located=(Region("sinkage_m", "pitch_rad", 0.0, np.radians(10.0), 0.5, 0.004, -3.0),))
    assert located_table(answer)[1] == [["sinkage z", "slope along the track", "0 to 10 deg", "50 %", "-3.0", "0.004"]]
    assert fit_table(answer)[1][1] == ["sinkage z [mm]", "2.8 (2.4 to 3.3)", "0.51 (0.48 to 0.56)", "0.5", "396"]
    headers, rows = soil_table(nothing())
    assert all(len(row) == len(headers) == 3 for row in rows)
    headers, rows = soil_table(explanation())
    assert all(len(row) == len(headers) == 4 for row in rows)


def test_where_nothing_was_added_the_soil_shown_is_that_of_the_json():
    answer = with_soil(nothing(), c_Pa=Estimate(500.0, 90.0, "Pa"))
    row = next(row for row in soil_table(answer)[1] if row[0] == "cohesion c")
    assert row[1] == "0.500 ± 0.090"
    assert answer.to_json()["soil"]["c_Pa"] == {"value": 500.0, "sd": 90.0, "unit": "Pa"}


def test_the_documentation_has_every_effect_and_every_key_of_the_json():
    page = (Path(__file__).resolve().parents[3] / "docs" / "explain.md").read_text(encoding="utf-8")
    rows = [line for line in page.split("## The effects")[1].splitlines() if line.startswith("| `")]
    assert rows == [f"| `{slug}` | {effect.kind} | {effect.what_happens} |" for slug, effect in REGISTRY.items()]
    assert f"**asserted** from {100 * ASSERTED:.0f} %" in page
    keys = set(re.findall(r"`(\w+)`", page.split("## The JSON")[1].split("## ")[0]))
    answer = explanation(sound=SOUND, screened=(Screened("drift", 0.1),)).to_json()
    parts = (answer["located"][0], answer["missing"][0], answer["candidates"][0], answer["screened"][0], answer["fit"])
    fits = answer["fit"]["channels"]["torque_Nm"]
    assert {*answer, *fits, *(key for part in parts for key in part)} - {"channels"} <= keys
