"""Where a campaign was written: the file, its seed, and the commit where there is one."""

import shutil
import subprocess

import pytest

from daemon.campaign import campaign_origin, load_campaign
from daemon.model.submission import CampaignOrigin
from grammars.text import codec

GIT = shutil.which("git")


def git(folder, *words):
    assert GIT is not None
    who = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    done = subprocess.run(
        [GIT, "-C", str(folder), *who, *words], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def folder(tmp_path, campaigns):
    """The campaign of the demonstration by itself."""
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / "here" / name)
    return tmp_path / "here" / "demo"


def origin(folder):
    file = folder / "campaign.yaml"
    return campaign_origin(load_campaign(file), file)


def test_without_git_the_file_and_its_seed_are_known(folder, monkeypatch):
    monkeypatch.setenv("PATH", "")
    found = origin(folder)
    assert (found.file, found.seed, len(found.digest)) == ("campaign.yaml", 7, 64)
    assert (found.commit, found.branch, found.changed) == ("", "", None)


@pytest.mark.skipif(GIT is None, reason="no git is installed")
def test_the_commit_is_told_and_what_is_not_in_it(folder, monkeypatch):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(folder.parent.parent))
    assert origin(folder).commit == ""
    git(folder.parent, "init", "-q", "-b", "trunk")
    assert (origin(folder).commit, origin(folder).changed) == ("", True)
    (folder / ".gitignore").write_text("campaign.yaml\n", encoding="utf-8")
    assert origin(folder).changed is None
    (folder / ".gitignore").unlink()
    git(folder.parent, "add", "robots", "suts")
    git(folder.parent, "commit", "-q", "-m", "robots")
    assert origin(folder).changed is True  # the campaign's own file is in no commit
    git(folder.parent, "add", ".")
    git(folder.parent, "commit", "-q", "-m", "all")
    found = origin(folder)
    assert (found.commit, found.branch) == (git(folder.parent, "rev-parse", "HEAD"), "trunk")
    assert found.changed is False
    (folder / "results.html").write_text("left there", encoding="utf-8")
    assert origin(folder).changed is False
    robot = next((folder.parent / "robots").iterdir())
    robot.write_text(robot.read_text("utf-8") + "\n# another robot\n", encoding="utf-8")
    assert origin(folder).changed is True


@pytest.mark.skipif(GIT is None, reason="no git is installed")
def test_the_repository_of_a_hook_is_not_that_of_the_campaign(folder, monkeypatch):
    git(folder.parent, "init", "-q", "-b", "trunk")
    git(folder.parent, "add", ".")
    git(folder.parent, "commit", "-q", "-m", "all")
    whole = origin(folder)
    assert whole.changed is False
    other = folder.parent.parent / "other"
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY"):
        monkeypatch.setenv(name, str(other))
    assert origin(folder) == whole


def test_a_campaign_that_has_no_path_keeps_the_digest_it_had_before_paths_were_kept():
    assert b"path" not in codec.to_json(CampaignOrigin())
    assert b'"path":"/there.yaml"' in codec.to_json(CampaignOrigin(path="/there.yaml"))
