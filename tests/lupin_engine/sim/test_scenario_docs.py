"""The page about testing missions: every scenario on it runs, and does what the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.sim.failure import failure_lines
from lupin_engine.sim.scenario import Missions, load_scenario
from lupin_engine.sim.scenario_file import ExpectNode, OutcomeNode, WhenNode
from tests import shipped

PAGE = Path(__file__).parents[3] / "docs" / "testing-missions.md"
TEXT = PAGE.read_text(encoding="utf-8")
#: A scenario with what is said before it: `<!-- NAME fails -->`, or nothing.
BLOCKS = re.findall(r"(?:<!-- (\S+) fails -->\n)?```yaml\n(.*?)```", TEXT, re.DOTALL)
#: The beginnings of reports, one for each scenario that fails.
REPORTS = re.findall(r"```text\n(.*?)```", TEXT, re.DOTALL)
MISSIONS = Missions(shipped.catalog())


@pytest.mark.parametrize(("fails", "text"), BLOCKS, ids=[text.splitlines()[0] for _, text in BLOCKS])
def test_a_scenario_of_the_page(
    fails: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It holds, or fails with the report that the page shows the beginning of."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / (fails or "x.scenario.yaml")
    file.write_text(text, encoding="utf-8")
    scenario = load_scenario(file, shipped.catalog(), MISSIONS)
    found = "\n".join(line for _, line in failure_lines(scenario.failures(scenario.run())))
    if fails:
        assert any(found.startswith(told) for told in REPORTS)
    else:
        assert not found


def test_there_are_scenarios_on_the_page() -> None:
    """What is tested here is there."""
    assert len(BLOCKS) == TEXT.count("```yaml") >= 6
    assert len([fails for fails, _ in BLOCKS if fails]) == len(REPORTS) == 1


@pytest.mark.parametrize("model", [OutcomeNode, WhenNode, ExpectNode], ids=lambda model: model.__name__)
def test_every_word_is_on_the_page(model: type[OutcomeNode] | type[WhenNode] | type[ExpectNode]) -> None:
    """A word that the page does not say is a word that nobody finds."""
    words = [field.alias or name for name, field in model.model_fields.items()]
    assert [word for word in words if not re.search(rf"\b{word}\b", TEXT)] == []
