"""Missions that no author writes: hundreds of states, and markup in every text."""

from __future__ import annotations

import shutil
from pathlib import Path

from lupin_engine.missions.folders import default_missions_folder

#: What would run, were a text of it taken for markup.
MARKUP = "<script>pwned=1</script><img src=x onerror='pwned=1'><b>bold</b> & \"quoted\""
GROUP = 9


def large_missions(
    folder: Path, states: int, *, seconds: float = 1.0, again: str = "", across: bool = False
) -> Path:
    """Copy the shipped missions to `folder`, and beside them one of so many states that goes round in itself.

    It stays in each state for so many `seconds`. `again` changes its text, and by that the chart's hash. With
    `across` ways lead from some states into another group, which it never takes.
    """
    shutil.copytree(default_missions_folder(), folder, dirs_exist_ok=True)
    groups = -(-states // (GROUP + 1))
    quoted = MARKUP.replace("'", "''")
    lines = [
        f"mission: LargeMission # {again}",
        f"summary: '{quoted}'",
        "codes:",
        f"  odd: {{label: '{quoted}', severity: warn}}",
        "initial: GROUP_0",
        "states:",
    ]
    for group in range(groups):
        lines += [
            f"  GROUP_{group}:",
            f"    summary: '{quoted}'",
            f"    on_done: GROUP_{(group + 1) % groups}",
            "    initial: A_0",
            "    states:",
        ]
        lines += [
            "      A_0:",
            f"        ask: {{question: '{quoted}', choices: {{go: '{quoted}'}}, default: go,",
            f"              after: {seconds} s}}",
            "        on: {answer.go: {target: A_1, code: odd}}",
        ]
        for leaf in range(1, GROUP - 1):
            lines += [
                f"      A_{leaf}:",
                f"        summary: 'a\\nb {quoted}'",
                f"        after: {{{seconds} s: A_{leaf + 1}{_way_across(group, leaf, groups, across)}}}",
            ]
        lines += [f"      A_{GROUP - 1}: {{type: final}}"]
    (folder / "large.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def _way_across(group: int, leaf: int, groups: int, across: bool) -> str:
    # Few: what many of them cost is measured where the layout is tested.
    is_one = across and leaf == 1 and group % 3 == 0
    return f", 1 h: GROUP_{(7 * group + 3) % groups}.A_{leaf}" if is_one else ""
