"""Mutation scores: of a fixed sample of small changes to the code, how many do the tests notice?

Cosmic Ray makes the changes, each alone, in a copy of the tree, and runs tests. The hash of its operator and
line chooses a change: two versions of the code are asked about the same ones where their lines agree.
"""

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.plugins import get_operator, operator_names
from cosmic_ray.work_item import MutationSpec

ROOT, SEED = Path(__file__).resolve().parents[1], 13
#: Cosmic Ray's operators whose changes a test should notice: not `==` for `is`, nor `|` in annotations.
OPERATORS = re.compile(
    r"core/(AddNot|Replace(And|Or|True|False|Break|Continue)With\w+|ExceptionReplacer|NumberReplacer"
    r"|ZeroIterationForLoop|ReplaceUnaryOperator_(Delete_Not|USub_UAdd)"
    r"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|FloorDiv_Div|Mod_Mul)|ReplaceComparisonOperator_"
    r"(Eq_NotEq|NotEq_Eq|Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt|Is_IsNot|IsNot_Is))"
)
#: Of each room: how many changes, to which modules, and the tests that are asked.
SAMPLE = {
    "machine": (
        16,
        "lupin_engine/machine/*.py",
        "tests/lupin_engine/machine --ignore=tests/lupin_engine/machine/properties",
    ),
    "expressions": (10, "lupin_engine/chart/expressions/*.py", "tests/lupin_engine/chart/expressions"),
    "compose": (
        10,
        "lupin_engine/chart/compose/*.py",
        "tests/lupin_engine/chart/test_model.py tests/lupin_engine/chart/rules",
    ),
    "rules": (
        10,
        "lupin_engine/chart/rules/*.py",
        "tests/lupin_engine/chart/rules tests/lupin_engine/chart/test_survivors.py",
    ),
    "sim": (
        10,
        "lupin_engine/sim/*.py",
        "tests/lupin_engine/sim/test_simulation.py tests/lupin_engine/sim/test_scenario.py",
    ),
    "runtime": (
        10,
        "lupin_engine/runtime/*.py",
        "tests/lupin_engine/runtime tests/lupin_engine/replay/test_scenario_recorded.py",
    ),
}
for plugin, names in {  # modules that need no ROS, each with a file of tests
    "arm": "joints library player presets trajectory",
    "bridge": "recorded topics units",
    "greenhouse": "frames layout numbers poses",
    "nav": "approach exploration frontier overrides",
    "perception": "boxes detections flowers layout memory registry sightings",
    "twin": "field heatmap state store text",
}.items():
    shape = f"plugins/lupin_{plugin}/{{}}.py", f"tests/plugins/{plugin}/test_{{}}.py"
    SAMPLE[plugin] = (6, *(" ".join(map(place.format, names.split())) for place in shape))


def select(paths: list[Path], number: int) -> list[MutationSpec]:
    """Return the changes to try."""
    ranks, seen = {}, Counter[str]()
    for path in paths:
        tree, lines = get_ast_from_path(path), path.read_text().splitlines()
        for name in filter(OPERATORS.fullmatch, operator_names()):
            operator = get_operator(name)()
            places = (place for node in ast_nodes(tree) for place in operator.mutation_positions(node))
            for occurrence, (start, end) in enumerate(places):
                line = lines[start[0] - 1]
                key = f"{SEED} {name} {start[1] - len(line) + len(line.lstrip())} {line.strip()}"
                seen[key] += 1
                rank = hashlib.sha256(f"{key} {seen[key]}".encode()).digest()
                ranks[rank] = MutationSpec(path, name, occurrence, start, end)
    return [ranks[rank] for rank in sorted(ranks)[:number]]


def score(room: str) -> tuple[int, int]:
    """Print the changes that no test notices; return how many are noticed, and how many are tried."""
    number, modules, tests = SAMPLE[room]
    chosen = select(sorted(path for glob in modules.split() for path in Path().glob(glob)), number)
    command = f"'{sys.executable}' -m pytest -x -q -p no:cacheprovider {tests}"
    subprocess.run(shlex.split(command), check=True, stdout=subprocess.DEVNULL)  # passes without a change
    results = [mutate_and_test([change], command, 180) for change in chosen]
    survivors = [str(result.diff) for result in results if not result.is_killed]
    print(*survivors, f"{room}: {len(survivors)} of {len(chosen)} survived", sep="\n", flush=True)
    return len(chosen) - len(survivors), len(chosen)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        hidden = shutil.ignore_patterns(".*", "__pycache__")
        os.chdir(shutil.copytree(ROOT, Path(scratch, "tree"), ignore=hidden))
        os.environ["PYTHONPATH"] = os.pathsep.join(
            (os.getcwd(), os.path.abspath("workbench"), os.path.abspath("plugins"))
        )
        scores = {room: score(room) for room in sys.argv[1:] or SAMPLE}
        os.chdir(ROOT)
    for room, (killed, tried) in scores.items():
        print(f"| {room} | {tried} | {killed} | {killed / tried:.0%} |")
