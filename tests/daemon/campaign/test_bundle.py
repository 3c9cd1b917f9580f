"""A campaign handed on as files: all that it reads, nothing else, and nothing that leads away."""

import base64
import shutil
from pathlib import Path

import pytest

from daemon.campaign import bundle_campaign, expand, load_campaign
from daemon.model.bundles import unpack_bundle
from grammars.text.diagnostics import InputError
from grammars.text.sources import reading_only_in


@pytest.fixture
def folder(tmp_path, campaigns):
    """The files of a campaign far from everything that ships."""
    return Path(shutil.copytree(campaigns / "demo", tmp_path / "project" / "mine"))


def digests(path):
    return [spec.digest for spec in expand(load_campaign(path)).specs]


def coded(data):
    return base64.b64encode(data).decode()


@pytest.mark.parametrize("name", ["demo", "two_lasers"])
def test_an_unpacked_campaign_means_the_same_runs(name, campaigns, tmp_path):
    file = campaigns / name / "campaign.yaml"
    place, files = bundle_campaign(file)
    assert place == f"{name}/campaign.yaml"
    unpack_bundle(files, tmp_path / "there")
    with reading_only_in(tmp_path / "there"):
        unpacked = digests(tmp_path / "there" / place)
    assert unpacked == digests(file)


def test_what_ships_travels_and_neighbours_do_not(folder):
    (folder / "other.yaml").write_text("campaign: other\noracles: navigation\n")
    place, files = bundle_campaign(folder / "campaign.yaml")
    paths = [file.path for file in files]
    assert place == "campaign.yaml"
    assert "robots/courier.yaml" in paths  # one that ships, where the campaign finds it first
    assert "people.scenery" not in paths
    assert "other.yaml" not in paths
    assert paths == sorted(paths)


def test_files_beside_the_folder_keep_their_places(folder):
    shutil.move(folder / "courier.mission.yaml", folder.parent / "courier.mission.yaml")
    text = (folder / "campaign.yaml").read_text()
    text = text.replace("mission: courier\n", "mission: ../courier.mission.yaml\n")
    (folder / "campaign.yaml").write_text(text)
    place, files = bundle_campaign(folder / "campaign.yaml")
    assert place == "mine/campaign.yaml"
    assert "courier.mission.yaml" in [file.path for file in files]


def test_a_file_named_by_its_whole_path_is_refused(folder):
    mission = shutil.move(folder / "courier.mission.yaml", folder.parent / "far.mission.yaml")
    text = (folder / "campaign.yaml").read_text().replace("mission: courier", f"mission: {mission}")
    (folder / "campaign.yaml").write_text(text)
    with pytest.raises(InputError, match="cannot be handed on: elsewhere no file"):
        bundle_campaign(folder / "campaign.yaml")


def test_a_file_that_lies_too_far_is_refused(folder, tmp_path):
    deep = tmp_path / "a" / "b" / "c" / "d"
    shutil.copytree(folder, deep)
    shutil.move(deep / "courier.mission.yaml", tmp_path / "far.mission.yaml")
    text = (deep / "campaign.yaml").read_text()
    text = text.replace("mission: courier", "mission: ../../../../far.mission.yaml")
    (deep / "campaign.yaml").write_text(text)
    with pytest.raises(InputError, match="lies too far from it"):
        bundle_campaign(deep / "campaign.yaml")


def test_a_folder_behind_a_link_is_handed_on(folder, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(folder)
    place, _ = bundle_campaign(link / "campaign.yaml")
    assert place == "campaign.yaml"


def test_too_much_is_refused_with_the_largest_file(folder, monkeypatch):
    monkeypatch.setattr("daemon.campaign._bundle.LARGEST_BUNDLE", 4_000)
    with pytest.raises(InputError, match=r"the largest is \S+"):
        bundle_campaign(folder / "campaign.yaml")


def test_an_unpacked_campaign_reads_nothing_from_around_it(folder, tmp_path):
    secret = tmp_path / "secret.mission.yaml"
    secret.write_text("mission: hidden\nwaypoints: [{x: 1.0, y: 0.0}]\n")
    for way in (str(secret), "../../secret.mission.yaml", "link.mission.yaml"):
        (folder / "link.mission.yaml").unlink(missing_ok=True)
        (folder / "link.mission.yaml").symlink_to(secret)
        text = (folder / "campaign.yaml").read_text()
        (folder / "tried.yaml").write_text(text.replace("mission: courier", f"mission: {way}"))
        assert load_campaign(folder / "tried.yaml").cells[0].mission.name == "hidden"
        with reading_only_in(folder), pytest.raises(InputError) as caught:
            load_campaign(folder / "tried.yaml")
        assert "hidden" not in str(caught.value)
        assert any("mission" in d.message for d in caught.value.diagnostics)
