"""A campaign in a large building comes back from JSON-LD, as the demonstration does."""

from tests.languages.test_jsonld_scenery import assert_a_campaign_comes_back


def test_the_campaign_of_the_paper_fits_the_shapes_and_comes_back(campaigns, tmp_path):
    names = ("building_c", "doors", "doors_random", "doors_open", "close_on_approach")
    assert_a_campaign_comes_back(campaigns, tmp_path, "ortega2024", *names)
