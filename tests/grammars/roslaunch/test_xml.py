"""XML from elsewhere: no document types, no entities, no surprise of any kind."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.text.diagnostics import InputError
from tests.grammars.roslaunch.launched import launch, parameters

BOMB = (
    '<!DOCTYPE launch [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n'
    '<launch><param name="x" value="&b;"/></launch>'
)
OUTSIDE = '<!DOCTYPE launch SYSTEM "http://example.org/x.dtd">\n<launch/>'
FILE = '<!DOCTYPE launch [<!ENTITY a SYSTEM "file:///etc/passwd">]><launch>&a;</launch>'


@pytest.mark.parametrize("text", [BOMB, OUTSIDE, FILE])
def test_document_types_and_entities_are_refused(tmp_path, text):
    (tmp_path / "a.launch").write_text(text)
    with pytest.raises(InputError, match="has a document type"):
        launch(tmp_path / "a.launch")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is not valid XML: no element found"),
        ("<launch>\n  <arg name='a'\n</launch>", "a.launch:3:1: is not valid XML"),
        ("<launch>&b;</launch>", "a.launch:1:9: is not valid XML: undefined entity"),
        ("<robot/>", "a.launch:1:1: <robot> is no launch file"),
        ("<a>" * 60 + "</a>" * 60, "is nested deeper than 50 levels"),
        ("<launch/><launch/>", "junk after document element"),
        ("just some words, no file", "is not valid XML: syntax error"),
    ],
)
def test_what_is_no_launch_file_is_said_where_it_ends_to_be_one(tmp_path, text, expected):
    (tmp_path / "a.launch").write_text(text)
    with pytest.raises(InputError) as caught:
        launch(tmp_path / "a.launch")
    assert expected in str(caught.value)


def test_texts_in_other_letters_keep_their_places(tmp_path):
    text = (
        '<?xml version="1.0" encoding="ISO-8859-1"?>\n'
        '<launch><!-- größer -->\n<node pkg="amcl" type="amcl" name="amcl">\n'
        '<param name="ä" value = \'ö\' /><param name="b" value="1"/></node></launch>'
    )
    (tmp_path / "a.launch").write_text(text, encoding="utf-8")
    loaded = launch(tmp_path / "a.launch")
    assert parameters(loaded, "/amcl") == {"ä": "ö", "b": 1}
    assert [p.where.column for p in loaded.nodes[0].parameters.values()] == [26, 54]


@given(text=st.text(st.sampled_from("<>/ launchgroupinclude=\"'$()&;!?-[]\n\0ä"), max_size=60))
def test_any_text_is_read_or_refused(text, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "any.launch"
    path.write_text(f"<launch>{text}</launch>", encoding="utf-8")
    try:
        launch(path)
    except InputError as error:
        assert all(one.where.file == str(path) for one in error.diagnostics)
