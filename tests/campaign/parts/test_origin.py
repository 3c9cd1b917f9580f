"""Where a campaign was written: the file, its seed, and the commit where there is one."""

import shutil
import subprocess

import pytest

from daemon.campaign import campaign_origin, load_campaign
from daemon.model.submission import CampaignOrigin
from grammars.text import codec

GIT = shutil.which("git")
needs_git = pytest.mark.skipif(GIT is None, reason="no git is installed")


def git(folder, *words):
    author = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    done = subprocess.run(
        [GIT, "-C", str(folder), *author, *words], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def commit_all(folder):
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "all")


@pytest.fixture
def origin(demo, tmp_path, campaigns, monkeypatch):
    """The origin of the campaign of the demonstration, whose robot lies in the folder above it."""
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    (tmp_path / "robots").mkdir()
    shutil.copy(campaigns / "robots" / "courier.yaml", tmp_path / "robots")
    file = demo / "campaign.yaml"
    return lambda: campaign_origin(load_campaign(file), file)


def test_without_git_the_file_and_its_seed_are_known(origin, monkeypatch):
    monkeypatch.setenv("PATH", "")
    found = origin()
    assert (found.file, found.seed, len(found.digest)) == ("campaign.yaml", 7, 64)
    assert (found.commit, found.branch, found.changed) == ("", "", None)


@needs_git
def test_the_commit_and_whether_the_campaign_differs_from_it_are_known(origin, demo, tmp_path):
    assert origin().commit == ""
    git(tmp_path, "init", "-q", "-b", "trunk")
    assert (origin().commit, origin().changed) == ("", True)
    (demo / ".gitignore").write_text("campaign.yaml\n")
    assert origin().changed is None
    (demo / ".gitignore").unlink()
    git(tmp_path, "add", "robots")
    git(tmp_path, "commit", "-q", "-m", "robots")
    assert origin().changed is True  # the campaign's own file is in no commit
    commit_all(tmp_path)
    found = origin()
    assert (found.commit, found.branch) == (git(tmp_path, "rev-parse", "HEAD"), "trunk")
    assert found.changed is False
    (demo / "results.html").write_text("a file that is none of the campaign")
    assert origin().changed is False
    with (tmp_path / "robots" / "courier.yaml").open("a") as robot:
        robot.write("\n# another robot\n")
    assert origin().changed is True


@needs_git
def test_the_repository_of_a_hook_is_not_that_of_the_campaign(origin, tmp_path, monkeypatch):
    git(tmp_path, "init", "-q", "-b", "trunk")
    commit_all(tmp_path)
    expected = origin()
    assert expected.changed is False
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY"):
        monkeypatch.setenv(name, str(tmp_path / "other"))
    assert origin() == expected


def test_a_campaign_that_has_no_path_keeps_the_digest_it_had_before_paths_were_kept():
    assert b"path" not in codec.to_json(CampaignOrigin())
    assert b'"path":"/there.yaml"' in codec.to_json(CampaignOrigin(path="/there.yaml"))
