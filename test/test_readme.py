"""What the README shows is what there is."""

import re
from pathlib import Path

import pytest

from fish_train.commands.verbs import VERBS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def section(title):
    return README.split(f"\n{title}\n", 1)[1].split("\n## ", 1)[0]


def test_the_example_effect_is_the_one_that_a_test_executes():
    page = (ROOT / "src" / "fish_sim" / "docs" / "adding_an_effect.md").read_text()
    examples = re.findall(r"```python\n(.*?)```", section("## Adding an effect, adding a path"), re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        assert example in page


def test_every_verb_is_listed():
    listed = re.findall(r"^\| `(\w+)[^`]*` \|", section("### The `fish_train` command"), re.MULTILINE)
    assert set(listed) == set(VERBS)


@pytest.mark.parametrize("file", sorted(ROOT.glob("requirements*.txt")), ids=lambda file: file.name)
def test_every_dependency_is_pinned_and_has_a_reason(file):
    table = section("## Dependencies").lower()
    lines = [line for line in file.read_text().splitlines() if line and not line.startswith("#")]
    for line in lines:
        package, version = line.split("==")
        assert version
        assert re.search(rf"\b{re.escape(package.split('[')[0].lower())}\b", table), package


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target
