"""Links of every page lead somewhere, and every page is reached from the start."""

from tests.docs.markdown import DOCS, broken, links, pages


def test_every_link_leads_to_a_file_and_a_heading():
    found = [broken(link) for page in pages() for link in links(page)]
    assert [problem for problem in found if problem] == []


def test_the_start_page_leads_to_every_page():
    start = DOCS / "index.md"
    reached = {(DOCS / link.target.partition("#")[0]).resolve() for link in links(start)}
    assert set(DOCS.rglob("*.md")) - reached - {start} == set()
