"""The pages, looked at by axe-core: nothing serious in either theme, wide and narrow."""

from __future__ import annotations

from pathlib import Path

from axe import needs_axe, serious_faults
from browser import Browser
from problems import fitted, regular
from small_jobs import write_folder

from miurafab.workflow.fold import fold
from miurafab.workflow.page import write_page
from miurafab.workflow.preview import preview

pytestmark = needs_axe


def test_the_pages_of_a_motion_and_of_a_preview_have_no_serious_fault(tmp_path: Path) -> None:
    pattern = fitted("sphere", 10, 10).pattern
    assert pattern is not None
    fold(pattern, 6).save(tmp_path / "motion.html", colour="strain")
    job = preview(write_folder(tmp_path / "job", regular()))
    write_page(tmp_path / "preview.html", title="job", preview=job, pattern=job.pattern)
    with Browser(tmp_path / "profile") as page:
        for name in ("motion", "preview"):
            page.open(tmp_path / f"{name}.html")
            for width in (1280, 390):
                page.call(
                    "Emulation.setDeviceMetricsOverride",
                    width=width, height=800, deviceScaleFactor=1, mobile=width < 600,
                )  # fmt: skip
                assert serious_faults(page) == [], (name, width)
                assert page.run("document.documentElement.scrollWidth") <= width
        page.run('document.getElementById("play").textContent = ""')
        assert any("button-name: #play" in fault for fault in serious_faults(page))
