"""The protocol holds in every reachable state of its model, and every rule is needed: without it, the search
finds the attack."""

import pytest
from protocol_model import RULES, Scenario, Search, without

SCENARIOS = {
    "arm against disarm": Scenario((("arm", 0), ("disarm", 0))),
    "arm against arm": Scenario((("arm", 0), ("arm", 0))),
    "drive against disarm": Scenario((("drive", 0), ("disarm", 0))),
    "a robot each": Scenario((("arm", 0), ("arm", 1))),
    "not ready to arm": Scenario((("arm", 0), ("disarm", 0)), ready=False, signatures=1),
    "started again": Scenario((("arm", 0), ("disarm", 0)), restart=True, signatures=1),
}

# Rules taken away, where, and what the search must find.
ATTACKS = [
    ("arm against disarm", ["announcements are signed"], "false success"),
    ("a robot each", ["sender checks the robot's name"], "wrong robot"),
    ("arm against disarm", ["sender waits for an answer to itself"], "locked out"),
    ("arm against disarm", ["sender checks who is confirmed"], "false success"),
    (
        "arm against disarm",
        ["announcements are signed", "sender counts for itself", "sequence jumps are bounded"],
        "locked out: the counter",
    ),
    ("started again", ["command is bound to the session"], "twice"),
    ("arm against disarm", ["command answers a recent announcement"], "late: obeyed"),
    ("drive against disarm", ["sequence grows"], "twice"),
    ("arm against disarm", ["command is bound to the turn"], "twice"),
    ("arm against disarm", ["disarm begins a turn"], "after a later disarm"),
    ("not ready to arm", ["arm request expires"], "late: armed"),
]


@pytest.mark.parametrize("name", SCENARIOS)
def test_no_command_is_obeyed_twice_late_after_a_disarm_or_by_the_wrong_robot(name):
    search = Search(SCENARIOS[name])
    assert search.run() is None
    assert search.states > 5000


@pytest.mark.parametrize(("name", "rules", "found"), ATTACKS, ids=[" + ".join(a[1]) for a in ATTACKS])
def test_without_a_rule_the_search_finds_the_attack(name, rules, found):
    violation = Search(without(SCENARIOS[name], *rules)).run(found)
    assert violation is not None and violation.startswith(found)


def test_every_rule_is_taken_away_once():
    assert {rule for _, rules, _ in ATTACKS for rule in rules} == RULES
