"""What the README shows is what there is."""

import json
import re
from pathlib import Path

import pytest

from fish_control.excitation import LAST_ROW
from fish_report.robofish import VERBS
from fish_sysid.diagnosis.vocabulary import known

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


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
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))], ids=lambda page: page.name
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
