"""The arm, moved by the page over the real nodes of the arm."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Locator, Page, expect

from tests.browsing import HOLD_MS
from tests.lupin_ros.system.console.asking import command

pytestmark = pytest.mark.long


@pytest.fixture
def arm(console: Page) -> Page:
    """The view of the arm, which can be moved."""
    command(console, "abort")
    console.evaluate("location.hash = 'arm'")
    expect(button(console, "inspect")).to_be_enabled()
    return console


def button(page: Page, name: str) -> Locator:
    """A button of the view; others stand beside it."""
    return page.locator(".arm").get_by_role("button", name=name, exact=True)


def joint(page: Page, name: str) -> Locator:
    """What a joint measures, and where it was sent."""
    return page.locator(f"output[for='joint-{name}']")


def answer(page: Page) -> Locator:
    """What the arm answered last."""
    return page.locator(".arm-state p[role=status]")


def test_a_preset_moves_the_arm_and_a_slider_one_joint(arm: Page) -> None:
    button(arm, "inspect").click()
    expect(answer(arm)).to_contain_text("inspect")
    expect(joint(arm, "elbow")).to_have_text(re.compile(r"^51\.[56]° $"))
    slider = arm.get_by_label("wrist", exact=True)
    assert slider.get_attribute("min") == "-90"
    assert slider.get_attribute("max") == "88"
    slider.press("ArrowRight")
    expect(answer(arm)).to_have_text("✓ sent")
    expect(joint(arm, "wrist")).to_have_text(re.compile(r"^-4[45](\.\d)?° $"))
    button(arm, "Close the gripper").click()
    expect(joint(arm, "gripper")).to_have_text("30° ")


def test_a_pose_is_saved_gone_to_renamed_and_deleted(arm: Page) -> None:
    expect(button(arm, "Save this pose")).to_be_disabled()
    arm.get_by_label("Name", exact=True).fill("Bad Name!")
    button(arm, "Save this pose").click()
    expect(answer(arm)).to_contain_text("✖")
    expect(answer(arm)).to_contain_text("a name has")
    arm.get_by_label("Name", exact=True).fill("over_pot")
    button(arm, "Save this pose").click()
    expect(answer(arm)).to_contain_text("saved 'over_pot'")
    button(arm, "tuck").click()
    expect(joint(arm, "elbow")).to_have_text("90° ")
    button(arm, "Go to over_pot").click()
    expect(joint(arm, "elbow")).not_to_have_text("90° ")
    arm.get_by_label("Name", exact=True).fill("pot")
    button(arm, "Rename over_pot").click()
    button(arm, "Delete pot").click()
    arm.get_by_role("group", name="Delete pot?").get_by_role("button", name="No").click()
    expect(arm.get_by_role("row", name="pot")).to_be_visible()
    button(arm, "Delete pot").click()
    expect(arm.get_by_role("button", name="Yes")).to_be_focused()
    arm.keyboard.press("Enter")
    expect(arm.get_by_text("Nothing is saved yet.")).to_be_visible()


def test_a_recording_is_made_and_played(arm: Page) -> None:
    arm.get_by_label("Name", exact=True).fill("wave")
    button(arm, "Record while steering").click()
    expect(arm.locator(".arm-state")).to_contain_text("records (teleop)")
    button(arm, "detect_left").click()
    expect(joint(arm, "shoulder_pan")).to_have_text("89° ")
    button(arm, "Save the recording").click()
    expect(arm.get_by_role("row", name="wave")).to_contain_text("points")
    button(arm, "home").click()
    expect(joint(arm, "shoulder_pan")).to_have_text("2.3° ")
    button(arm, "Play wave").click()
    expect(arm.locator(".arm-state progress")).to_be_visible()
    button(arm, "Stop playing").click()
    expect(arm.locator(".arm-state progress")).to_be_hidden()


def test_what_the_arm_refuses_is_said_in_its_words(arm: Page) -> None:
    button(arm, "Start").click()
    arm.get_by_role("button", name="Yes").click()
    expect(answer(arm)).to_contain_text("needs the real servos, and this is a simulation")
    button(arm, "Switch the servos off").click()
    arm.get_by_role("button", name="Yes").click()
    expect(arm.locator(".arm-state .pill", has_text="servos off")).to_be_visible()
    arm.get_by_label("elbow", exact=True).press("ArrowRight")
    expect(answer(arm)).to_contain_text("switch them on first (/lupin/arm/set_torque)")
    button(arm, "Switch the servos on").click()
    expect(arm.locator(".arm-state .pill", has_text="servos on")).to_be_visible()


def test_nothing_moves_under_a_stop_or_while_a_mission_runs(arm: Page) -> None:
    preset = button(arm, "inspect")
    arm.locator("#stop").click()
    expect(arm.locator(".why").first).to_have_text("the robot is stopped: release the stop first")
    expect(preset).to_be_disabled()
    arm.get_by_role("button", name="Release my stop").click(delay=HOLD_MS)
    expect(preset).to_be_enabled()
    assert command(arm, "start", "ExplorationMission")["accepted"]
    expect(arm.locator(".why").first).to_contain_text("a mission is running")
    expect(preset).to_be_disabled()
    expect(arm.get_by_label("elbow", exact=True)).to_be_disabled()
    command(arm, "abort")
    expect(preset).to_be_enabled()
