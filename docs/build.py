"""Rebuild the generated parts of the documentation: the reproduction pages and their figures.

    python docs/build.py [NAME ...]

Runs each published system 1000 times (the landing by inertial unit 30 times) with seed 0, as ``losnav
reproduce NAME --runs N`` does, judges every claim, and writes docs/reproductions/NAME.md and the figures of
docs/images. Needs the ``plot`` extra.
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from losnav import scenarios
from losnav.scenarios import verdicts
from losnav.scenarios.intervals import CONFIDENCE

DOCS = Path(__file__).resolve().parent
RUNS, SEED = 1000, 0
COLOURS = 256  # a quarter of the bytes, and shaded surfaces keep their tones


@dataclass(frozen=True)
class Page:
    """What a reproduction page says beside its claims."""

    title: str
    source: str
    runs: str  # "1000 ...", what one run is
    figures: tuple[str, ...]
    count: int = RUNS


#: One page for each scenario. Append here, and run this file with the scenario's name.
PAGES = {
    "landmark-landing": Page(
        title="Reproduction: landing by lines of sight to four landmarks",
        source="""\
Li Shuang, *Line-of-sight Measurement Based Autonomous Optical Relative Navigation Algorithms for Asteroid
Landing and Observability Analysis*, Acta Aeronautica et Astronautica Sinica 30(9), 2009, 1711–1717. What
is used where the publication is silent or wrong stands in
[equations](../equations.md#8-where-the-publication-differs) and in
`help("losnav.scenarios.landmark_landing")`.""",
        runs="landings of 216 images",
        figures=("descent", "errors-altitude", "cold-start", "danger-cylinder"),
    ),
    "star-tracker": Page(
        title="Reproduction: a star tracker of several heads",
        source="""\
Xiong Yazhou, Wu Yanpeng, Cheng Huiyan, *Attitude determination accuracy of multi-head star tracker based on
star-image fusion*, Journal of Chinese Inertial Technology 24(5), 2016, 612–618. Its tables are lost; what is
used instead stands in `help("losnav.scenarios.star_tracker")`. Claim 13 is its five properties of the
covariance ellipsoid, P1 to P5.""",
        runs="runs of every configuration of heads",
        figures=(
            "one-against-three",
            "head-separation",
            "fusion-frame",
            "fused-ellipsoids",
            "boresight-gain",
            "few-stars",
            "mounting-error",
            "fusion-consistency",
        ),
    ),
    "relative-navigation": Page(
        title="Reproduction: relative navigation to a non-cooperative satellite",
        source="""\
Li Litao, Yang Xu, Li Shunli, *Mid-range Relative Navigation Method for Non-cooperative Target Satellite*,
Journal of Jilin University (Engineering and Technology Edition) 38(4), 2008, 986 ff. What is used where the
publication is silent or wrong stands in `help("losnav.scenarios.relative_navigation")`; how to build such a
filter in the [tutorial](../tutorials/relative-navigation.md).""",
        runs="runs of 100 measurements (290 on the approach), every study on the same draws",
        figures=(
            "relative-trajectory",
            "relative-errors",
            "relative-consistency",
            "relative-accuracy",
            "relative-burn",
            "relative-attitude",
            "relative-frames",
        ),
    ),
    "sun-line-of-sight": Page(
        title="Reproduction: heliocentric navigation by the direction to the Sun alone",
        source="""\
Chang Xiaohua, Cui Pingyuan, Cui Hutao, *An observability analysis method of deep space autonomous navigation
system*, Journal of Harbin Institute of Technology 42(11), 2010, 1681–1685. What is used where the
publication is silent stands in `help("losnav.scenarios.sun_line_of_sight")`; information and bound in
[equations](../equations.md#12-information-along-an-arc). Claims 11 to 13 are not the publication's.""",
        runs="runs of 10 000 measurements on each of two arcs, every study on the same draws",
        figures=(
            "sun-degree",
            "sun-surfaces",
            "sun-index",
            "sun-accuracy",
            "sun-errors",
            "sun-consistency",
            "sun-large-errors",
        ),
    ),
    "small-body-landing": Page(
        title="Reproduction: landing on a small body when gravity is hardly known",
        source="""\
Ji Hongxia, Zong Hua, Huang Xiangyu, *Precise Landing Autonomous Navigation for Small Bodies Based on an
Improved Predictive Filter*, Journal of Deep Space Exploration 6(3), 2019. Its equations, tables and figures
are lost; what is used instead stands in `help("losnav.scenarios.small_body_landing")`; how to build such a
filter in the [tutorial](../tutorials/landing.md). Claims 1 to 7 are the publication's, 8 what it does not
ask. The body in the figures and in claim 7 is a made-up one; `--set shape=FILE` brings a real one.""",
        runs="descents of 600 images, all filters and studies on the same draws",
        figures=(
            "landing-descent",
            "landing-errors",
            "landing-gravity",
            "landing-nees",
            "landing-model-error",
            "landing-robustness",
            "landing-lost",
            "landing-field",
        ),
        count=30,
    ),
}

HEAD = """\
# {title}

{source}

This page is generated by `python docs/build.py {name}`: {runs} {what}, seed {seed}. For
other runs or seeds: `losnav reproduce {name} --runs {runs} --seed {seed}`. Brackets are
{confidence:.0%} intervals (bootstrap over the runs, or Clopper–Pearson for shares) unless another level
is given. A claim **holds** if its whole interval does, **does not** if none of it does, and is
**ambiguous** otherwise. {total}
"""
ROW = "| {number} | {verdict} | {statement} | {printed} | {ours} |"
NOTE = "**{number}** {why}"


def written(name: str, result) -> str:
    """The claims of a scenario as Markdown."""
    page, claims = PAGES[name], result.claims()
    hold, fail, open_ = (claims.tally(verdict) for verdict in ("holds", "does not", "ambiguous"))
    head = HEAD.format(
        name=name,
        title=page.title,
        source=page.source,
        what=page.runs,
        runs=result.runs,
        seed=result.seed,
        confidence=CONFIDENCE,
        total=f"Of {len(claims)} statements {hold} hold, {fail} do not, {open_} are ambiguous.",
    )
    rows = [ROW.format(**{**cells(claim), "verdict": f"**{claim.verdict}**"}) for claim in claims]
    notes = [NOTE.format(**cells(claim)) for claim in claims]
    table = ["| | verdict | claim | printed | ours |", "|---|---|---|---|---|", *rows]
    figures = [f"![{figure}](../images/{figure}.png)" for figure in page.figures]
    sections = [head, "\n".join(table), "## Why", *notes, "## Figures", *figures]
    return "\n\n".join(section.strip() for section in sections) + "\n"


def cells(claim: verdicts.Claim) -> dict[str, str]:
    """Texts of a claim that cannot break a table."""
    return {key: str(value).replace("|", "\\|") for key, value in claim.as_dict().items()}


def build(name: str) -> None:
    """Run a scenario, write its page and its figures."""
    result = scenarios.load(name).run(PAGES[name].count, SEED, progress=True)
    (DOCS / "reproductions" / f"{name}.md").write_text(written(name, result), encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        drawn = {path.stem: path for path in result.plot(folder)}
        for figure in PAGES[name].figures:
            target = DOCS / "images" / f"{figure}.png"
            with Image.open(drawn[figure]) as image:
                reduced = image.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
                reduced.save(target, optimize=True)


def main() -> None:
    for name in sys.argv[1:] or PAGES:
        build(name)


if __name__ == "__main__":
    main()
