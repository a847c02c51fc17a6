"""What the README shows is what there is."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from fish_control.excitation import LAST_ROW
from fish_report.robofish import VERBS
from fish_study.oracle_scores import judge_studies
from fish_study.score import score_world
from fish_study.study import Study
from fish_study.tables import ASKED, Share
from fish_study.truths import truths_of
from fish_sysid.diagnosis.vocabulary import known

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
STUDY = ROOT / "docs" / "studies" / "twentysixth"  # whose table the README shows


def section(title):
    return README.split(f"\n{title}\n", 1)[1].split("\n## ", 1)[0]


def test_the_example_effect_is_the_one_that_a_test_executes():
    page = (ROOT / "src" / "fish_sim" / "docs" / "adding_an_effect.md").read_text()
    examples = re.findall(
        r"```python\n(.*?)```", section("## Adding an effect, adding a path"), re.DOTALL
    )
    assert len(examples) == 2
    for example in examples:
        assert example in page


def test_the_diagnosis_from_python_can_be_pasted():
    """Its imports, its recordings and its names; the call itself takes a minute."""
    (example,) = re.findall(
        r"```python\n(.*?)```", section("## Which physics is missing"), re.DOTALL
    )
    imports, rest = example.split("\n\n", 1)
    names: dict[str, object] = {}
    exec(imports, names)
    used = set(re.findall(r"\b([a-zA-Z_]+)\(", rest)) - {"list", "print"}
    assert used == set(names) - {"__builtins__"}
    assert (ROOT / re.search(r'read_dataset\("(.*?)"\)', rest)[1]).is_dir()
    known(json.loads(re.search(r"names=(\[.*?\])", rest)[1]))


def test_the_readme_says_how_long_a_programs_last_row_lasts():
    assert f"the last row lasts {LAST_ROW:g} s" in README


def test_every_verb_is_listed():
    listed = re.findall(
        r"^\| `(\w+)[^`]*` \|", section("### The `fish_train` command"), re.MULTILINE
    )
    assert set(listed) == set(VERBS)


@pytest.mark.parametrize("file", sorted(ROOT.glob("requirements*.txt")), ids=lambda file: file.name)
def test_every_dependency_is_pinned_and_has_a_reason(file):
    table = section("## Dependencies").lower()
    lines = [line for line in file.read_text().splitlines() if line and not line.startswith("#")]
    for line in lines:
        package, version = line.split("==")
        assert version
        assert re.search(rf"\b{re.escape(package.split('[')[0].lower())}\b", table), package


def prose(page):
    """A page without its code, in which # begins a comment and not a heading."""
    return re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)


def anchors(page):
    """What GitHub calls the page's headings: small letters, words joined by hyphens, namesakes numbered from 1 on."""
    names = []
    for title in re.findall(r"^#{1,6} +(.+?) *#* *$", prose(page), re.MULTILINE):
        shown = re.sub(r"\[(.*?)\]\(.*?\)", r"\1", title)
        names.append(re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-"))
    before = [names[:k].count(name) for k, name in enumerate(names)]
    return [f"{name}-{n}" if n else name for name, n in zip(names, before, strict=True)]


def dead_links(page):
    """Targets within the project that are not there: files, and headings of Markdown pages."""
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        file, _, anchor = target.partition("#")
        place = page.parent / file if file else page
        if re.match(r"[a-z]+:", target):  # not of the project
            continue
        if not place.exists() or (
            anchor and place.suffix == ".md" and anchor not in anchors(place)
        ):
            dead.append(target)
    return dead


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))], ids=lambda page: page.name
)
def test_links_lead_somewhere(page):
    assert dead_links(page) == []


def test_a_link_to_a_heading_that_is_not_there_is_dead(tmp_path):
    (tmp_path / "there.md").write_text(
        "# What `it` is (2)\n```\n# no heading\n```\n## Twice 2\n## Twice\n## Twice\n"
    )
    page = tmp_path / "page.md"
    alive = (
        "there.md",
        "there.md#what-it-is-2",
        "there.md#twice-2",
        "there.md#twice-1",
        "#here",
        "https://a.b/#c",
    )
    dead = ("gone.md", "gone.md#twice", "there.md#no-heading", "there.md#twice-3", "#there")
    page.write_text("# Here\n" + " ".join(f"[a]({target})" for target in (*alive, *dead)))
    assert dead_links(page) == list(dead)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """A copy of the study whose table the README shows."""
    folder = tmp_path_factory.mktemp("study") / STUDY.name
    shutil.copytree(STUDY, folder)
    return [Study(part) for part in sorted(folder.iterdir())]


@pytest.fixture(scope="module")
def newest_study(parts):
    """Scores of all its parts, from the committed answers."""
    return [
        score_world(world, part.results[name], truths_of(world))
        for part in parts
        for name, world in part.reveal().items()
    ]


def errors_over_the_nominals(parts):
    """Of model.yaml in position, 2 s ahead on held-out trials, in every world of the second plant."""
    return [
        fit["model_yaml"]["rms"]["2 s"]["position_m"] / fit["nominal"]["rms"]["2 s"]["position_m"]
        for part in parts
        for name, world in part.reveal().items()
        if world.group == "mujoco"
        for fit in [part.results[name]["diagnosis"]["fit"]]
    ]


def test_the_studys_table_is_what_the_committed_answers_give(parts, newest_study):
    asked = {row.what: Share.of(filter(row.among, newest_study), row.is_so) for row in ASKED}
    expected = {
        "right name first, single effects and sensors": asked["right name first, single effects"],
        "the truth in the answered set": asked["truth in the answered set, single effects"],
        "right name first, closed loop only": asked["right name first, closed loop only"],
        "a wrong name first, in any world": Share.of(
            newest_study, lambda s: bool(s.named) and not s.top1
        ),
        "false alarms, nothing hidden": asked["false alarms, nothing hidden"],
        "both of two effects": asked["both of two effects"],
        "an effect without a name called unexplained": asked["no name exists: called unexplained"],
        "sensor impostors called physics": asked["sensor impostors called physics"],
    }
    rows = re.findall(
        r"^\| (.*?) \|(?: .*?)? \| (.*?) \|$",
        section("## Is the diagnosis right? A blind study"),
        re.MULTILINE,
    )
    for what, share in expected.items():
        (measured,) = [cell for first, cell in rows if first.startswith(what)]
        assert measured.startswith(f"{share.k} of {share.n}"), what
        if "(" in measured:
            low, high = (f"{100 * bound:.0f}" for bound in share.interval)
            assert f"({low} to {high} %)" in measured, what
    foreign = [score for score in newest_study if score.world.group == "mujoco"]
    (measured,) = [cell for first, cell in rows if first.startswith("second plant (MuJoCo)")]
    named, unexplained = (
        f"{sum(is_so(score) for score in foreign)} of {len(foreign)}"
        for is_so in (lambda score: bool(score.named), lambda score: score.verdict == "unexplained")
    )
    assert measured == f"{named}; {unexplained}; {np.median(errors_over_the_nominals(parts)):.2f}"
    seconds = [score.seconds for score in newest_study]
    (measured,) = [cell for first, cell in rows if first.startswith("seconds per data set")]
    assert measured == f"{np.median(seconds):.0f} ({max(seconds):.0f})"


def test_the_oracles_rows_are_what_the_committed_judgements_give(parts, newest_study):
    _, (against_truth, rivals) = judge_studies(parts, newest_study, 1, lambda _: None)
    measured = [row[-1] for row in against_truth.rows]
    detected, _, ratio, over_nominal, dof, iou, f1, alone = measured
    text = section("## Is the diagnosis right? A blind study")
    for cell in (
        detected.replace("%", " %"),
        f"{ratio.split()[0]}; {over_nominal}",
        dof,
        f"{iou.split()[0]}; {f1.split()[0]}; {alone}",
    ):
        assert f"| {cell} |" in text, cell
    tool, sparse = (row[1].split(" ")[0].split("/") for row in rivals.rows[:2])
    assert f"| {tool[0]}; {sparse[0]} of {sparse[1]} (" in text


def test_the_study_counts_every_world_and_seed(newest_study):
    text = section("## Is the diagnosis right? A blind study")
    assert f"of {len(newest_study)} " in text
    for about in STUDY.glob("*/study.json"):
        assert str(json.loads(about.read_text())["seed"]) in text
